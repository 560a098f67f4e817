"""Which pages have tables, and which function writes each."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial

from benchmarks.paper.page_tables import page_tables
from benchmarks.tables.attacks import attacks_table, fuzzed_table, spoilt_files_table
from benchmarks.tables.codes import error_codes_table
from benchmarks.tables.dim_frame import dim_frame_table
from benchmarks.tables.errors import (
    accuracy_table,
    edges_table,
    errors_table,
    looks_table,
    parts_table,
    real_front_table,
    short_accuracy_table,
    upsampling_table,
    versions_table,
)
from benchmarks.tables.ranges import range_end_table, range_table
from benchmarks.tables.records import CARDS, RESULTS, SOURCES
from benchmarks.tables.speed import (
    GPU_SPEEDS,
    VNNI_SPEEDS,
    ZEN3_SPEEDS,
    arm_instructions_table,
    card_speed_table,
    first_version_table,
    gpu_variants_table,
    real_time_priority_table,
    release_files_table,
    short_speed_table,
    soak_table,
    speed_table,
)
from benchmarks.tables.trust import (
    TRUST_PAGE,
    card_trust_table,
    causes_table,
    fault_naming_table,
    min_confidence_table,
    reasons_table,
    trust_sets_table,
    trust_table,
)
from benchmarks.tables.video import measuring_table, temporal_table

DOCUMENTS = (
    "README.md",
    "models/accurate.md",
    "models/fast-320.md",
    "models/fast.md",
    "models/wang2020.md",
    "docs/numbers.md",
    "docs/range.md",
    "docs/troubleshooting.md",
    "docs/trust.md",
    "docs/hardening.md",
    "docs/history/models.md",
    "docs/history/paper.md",
    "docs/live.md",
    "docs/measuring.md",
    "docs/paper/report.md",
    "docs/device/real-time.md",
    "docs/device/systems.md",
)
PLACE = re.compile(r"(<!-- table: (\S+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

TABLES: dict[str, Callable[[], str]] = {
    "accuracy": accuracy_table,
    "short-accuracy": short_accuracy_table,
    "short-speed": short_speed_table,
    "accuracy-cycles": partial(accuracy_table, "accuracy/accuracy_cycles"),
    "edges-cycles": partial(edges_table, "accuracy/accuracy_cycles"),
    "edges-lap": partial(edges_table, "accuracy/accuracy_lap"),
    "looks": looks_table,
    "real-front": real_front_table,
    "middlebury": partial(parts_table, "accuracy/middlebury"),
    "lap": partial(parts_table, "accuracy/accuracy_lap"),
    "lap-cycles": partial(parts_table, "accuracy/accuracy_lap_cycles"),
    "speed": partial(speed_table, VNNI_SPEEDS),
    "speed-zen3": partial(speed_table, ZEN3_SPEEDS),
    "speed-gpu": partial(speed_table, GPU_SPEEDS),
    "gpu-variants": gpu_variants_table,
    "range-end": range_end_table,
    "arm-instructions": arm_instructions_table,
    "attacks": attacks_table,
    "causes": causes_table,
    "dim-frame": dim_frame_table,
    "error-codes": error_codes_table,
    "fault-naming": fault_naming_table,
    "min-confidence": min_confidence_table,
    "reasons": reasons_table,
    "release-files": release_files_table,
    "first-version": first_version_table,
    "real-time-priority": real_time_priority_table,
    "soak": soak_table,
    "fuzzed": fuzzed_table,
    "measuring": measuring_table,
    "spoilt-files": spoilt_files_table,
    "temporal": temporal_table,
    "trust-sets": trust_sets_table,
    "upsampling": upsampling_table,
    "versions": versions_table,
}
TABLES |= {f"errors:{name}": partial(errors_table, name) for name in CARDS}
TABLES |= {f"trust:{name}": partial(trust_table, name) for name in TRUST_PAGE}
TABLES |= {f"short-trust:{name}": partial(card_trust_table, name) for name in ("fast", "fast-320", "accurate")}
TABLES |= {f"range:{name}": partial(range_table, name) for name in CARDS}
TABLES |= {f"speed:{name}": partial(card_speed_table, name) for name in CARDS}
TABLES |= page_tables(RESULTS, SOURCES / "docs" / "paper")


def filled(text: str, tables: Mapping[str, Callable[[], str]] = TABLES) -> str:
    """Return the document with every table written anew."""
    return PLACE.sub(lambda place: place[1] + tables[place[2]]() + place[3], text)
