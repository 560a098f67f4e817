"""How every reader takes spoilt files: answers, typed errors by code, and anything else, counted.

    python -m benchmarks.studies.spoilt_files --examples 2000

Each example is a valid file after one to six random edits, or random bytes. Examples are the same in every run.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from benchmarks.record import NO_MODEL, write_record
from endosdk.errors import EndoError
from tests.hardening.targets import TARGETS, Target, spoilt

RECORD = Path(__file__).parents[1] / "results" / "studies" / "spoilt_files.json"


def tried(target: Target, examples: int) -> dict[str, Any]:
    """Count the outcomes of one reader."""
    outcomes: Counter[str] = Counter()
    slowest = 0.0

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(st.data())
    def one(data: st.DataObject) -> None:
        nonlocal slowest
        content = data.draw(spoilt(target.seed()))
        begun = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                target.try_bytes(content)
            outcomes["read"] += 1
        except EndoError as error:
            outcomes[error.code.name] += 1
        except Exception as error:
            outcomes[f"untyped {type(error).__name__}"] += 1
        slowest = max(slowest, time.process_time() - begun)

    one()
    return {"tried": outcomes.total(), "outcomes": dict(outcomes.most_common()), "slowest_s": round(slowest, 3)}


def main() -> None:
    """Try all readers and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--examples", type=int, default=2000, help="of each reader (default %(default)s)")
    args = parser.parse_args()
    readers = {}
    for name, target in TARGETS.items():
        readers[name] = tried(target, args.examples)
        print(f"{name:24} {readers[name]}", flush=True)
    command = f"python -m benchmarks.studies.spoilt_files --examples {args.examples}"
    write_record(RECORD, {"readers": readers}, command=command, hashes=NO_MODEL)


if __name__ == "__main__":
    main()
