"""The range of disparities and depths that a model sees, and what the margin at its end costs."""

from __future__ import annotations

import math

import onnx

from benchmarks.tables import records
from benchmarks.tables.markdown import percent, table
from endosdk import _core
from endosdk.runtime.models import shipped_models
from endosdk.training.model_file import properties_of

WIDEST_UNRESIZED = 960  # px; wider frames are resized for a model that states no inference width
# Focal length over frame width and baseline in mm of three published rigs.
RIGS = {
    "a da Vinci (focal length / width 0.96, baseline 4.1 mm)": (0.96, 4.1),
    "a 3-D laparoscope (1.05, 4.8 mm)": (1.05, 4.8),
    "the rig of Wang et al. (0.42, 10 mm)": (0.42, 10.0),
}


def facts_of(model: str) -> dict[str, str]:
    """Return what a shipped file says of itself."""
    return properties_of(onnx.load(shipped_models()[model]))


def largest_disparity(facts: dict[str, str]) -> float:
    """Return the disparity from which a pixel counts as out of range, px at the network's input."""
    return int(facts["endosdk.max_candidate_disparity"]) - _core.range_margin


def range_table(model: str) -> str:
    """The nearest depth that one model sees on real rigs, from its own metadata.

    A model without an inference width takes frames up to 960 px as they are: its table is that of such frames.
    """
    facts = facts_of(model)
    end = largest_disparity(facts)
    stated = facts.get("endosdk.inference_width")
    share = end / int(stated or WIDEST_UNRESIZED)
    of = "the width" if stated else f"the width, frames {WIDEST_UNRESIZED} px wide"
    rows = [[f"range of disparities, % of {of} | 0 to {100 * share:.1f}"]]
    for label, (focal, baseline) in RIGS.items():
        rows.append([f"nearest depth on {label} | {math.ceil(focal * baseline / share)} mm"])  # as `doctor`: up
    return table(["what", "value"], rows)


def range_end_table() -> str:
    """What each margin before the last plane finds and loses, by model."""
    models = {name: records.read("accuracy/range_end")["models"][name] for name in ("fast", "wang2020")}
    what = ("marked_of_surfaces_beyond", "beyond_the_max_candidate_disparity_of_marked", "marked_of_right_answers")
    heads = ["margin, px"]
    for name, model in models.items():
        label = records.marked(f"`{name}`", model["model_sha256"])
        heads += [
            f"{label}: {part}"
            for part in ("much too near, and marked", "of the marked, too near", "correct pixels lost")
        ]
    rows = []
    for margins in zip(*(model["margins"] for model in models.values()), strict=True):
        cells = [f"{margins[0]['margin_px']:g}", *(percent(margin[key]) for margin in margins for key in what)]
        rows.append([f"**{cell}**" for cell in cells] if margins[0]["margin_px"] == _core.range_margin else cells)
    return table(heads, rows)
