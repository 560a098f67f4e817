"""The bench of the real dim frame counts the regions that it names."""

from types import SimpleNamespace

import numpy as np

from benchmarks.accuracy.dim_frame import STATED, measure, shares, stated
from benchmarks.tables import records
from benchmarks.tables.dim_frame import dim_frame_table
from endosdk import Reason
from endosdk.datasets.dataset import Sample
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig


def test_shares_are_of_the_region_alone():
    reasons = np.array([[0, 0, Reason.LOW_CONFIDENCE, Reason.LOW_CONFIDENCE | Reason.OCCLUDED, 8]], np.uint8)
    answer = SimpleNamespace(reasons=reasons)
    where = np.array([[True, False, True, True, False]])
    assert shares(answer, where) == {
        "pixels": 3,
        "valid": 0.3333,
        "reasons": {"LOW_CONFIDENCE": 0.6667, "OCCLUDED": 0.3333},
    }
    assert shares(answer, ~where & where) is None


def test_regions_are_those_of_the_rectified_view():
    """A raw pair of a rig that crops and shifts: the mask goes the same way, and dark ground is told from lit."""
    left, right = shifted_pair(480, 640, 9)
    left[:, :200] //= 40
    mask = np.zeros_like(left)
    mask[200:280, 400:500] = 255
    pair = Sample("1", left, right, np.full(left.shape[:2], np.nan, np.float32), None, None, np.nan, np.nan)
    found = measure(str(TINY_MODEL), pair, mask, raw_rig().scaled(640, 480))
    plain, circle, told = (found[name] for name in ("as it is", "circular field of view", STATED))
    assert plain["outside"] is None and circle["outside"]["pixels"] > 0.1 * left[..., 0].size
    assert 0.5 * 8000 < plain["mask"]["pixels"] == circle["mask"]["pixels"] < 2 * 8000
    assert plain["lit"]["pixels"] + plain["dark"]["pixels"] == left[..., 0].size
    assert 0.2 < plain["dark"]["pixels"] / left[..., 0].size < 0.45
    assert circle["lit"]["pixels"] + circle["dark"]["pixels"] + circle["outside"]["pixels"] == left[..., 0].size
    assert circle["outside"]["reasons"]["LOW_CONFIDENCE"] > 0.9 and circle["outside"]["valid"] < 0.05
    assert told["outside"]["reasons"]["OUTSIDE_VIEW"] > 0.95


def test_a_field_of_view_that_the_picture_cuts_is_stated_whole():
    rows, columns = np.indices((480, 640))
    outside = np.hypot(columns - 300, rows - 220) > 250
    rig = stated(raw_rig().scaled(640, 480), outside)
    assert rig.left_field_of_view == rig.right_field_of_view
    np.testing.assert_allclose(rig.left_field_of_view, (300, 220, 250, 250), atol=1.5)


def test_the_table_holds_what_its_heads_say(monkeypatch):
    def found(number, status, causes, outside):
        regions = {name: {"valid": (number + i) / 1000} for i, name in enumerate(("outside", "dark", "lit", "mask"))}
        return {"status": status, "causes": causes, **regions, **({} if outside else {"outside": None})}

    models = {
        "b": {"plain": found(100, "OK", {}, False), "circle": found(200, "OK", {}, True)},
        "a": {"plain": found(300, "DEGRADED", {"DIM": 3.0}, False), "circle": found(400, "INVALID", {}, True)},
    }
    record = {"model_sha256": {"a": "abc", "b": "abd"}, "models": models}
    monkeypatch.setattr(records, "shipped", lambda: {"abc", "abd"})
    monkeypatch.setattr(records, "read", {"accuracy/dim_frame": record}.__getitem__)
    assert dim_frame_table().splitlines()[0] == "| frame | valid | `b` | `a` |"
    assert dim_frame_table().splitlines()[2:] == [
        "| plain | status | OK | DEGRADED, DIM |",
        "| plain | disc of the heart | 10.3 % | 30.3 % |",
        "| plain | heart and ground, lit | 10.2 % | 30.2 % |",
        "| plain | ground, dark | 10.1 % | 30.1 % |",
        "| circle | status | OK | INVALID |",
        "| circle | disc of the heart | 20.3 % | 40.3 % |",
        "| circle | heart and ground, lit | 20.2 % | 40.2 % |",
        "| circle | ground, dark | 20.1 % | 40.1 % |",
        "| circle | outside the field of view | 20.0 % | 40.0 % |",
    ]
