"""Full-size maps, reasons, depth and expected error against the numpy twin, in every instruction set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from endosdk import _core
from endosdk._core import Reason
from endosdk.errors import InvalidArgument
from tests.core_rigs import every_isa
from tests.reference import postprocess, resampling

pytestmark = pytest.mark.usefixtures("restored_settings")

FOCAL, BASELINE = 640.0, 4.2


@dataclass
class Frame:
    """Inputs of one call, and what they are at full size."""

    disparity: np.ndarray
    confidence: np.ndarray
    size: tuple[int, int]
    stride: float

    def run(self, **options) -> tuple[int, dict[str, np.ndarray]]:
        height, width = self.size
        out = {name: np.full((height, width), -7, np.float32) for name in ("disparity", "confidence", "depth", "sigma")}
        out["reasons"] = np.full((height, width), 255, np.uint8)
        metric = "focal_px" in options
        wanted = {name: out[name] for name in out if metric or name not in ("depth", "sigma")}
        fields = {
            "disparity": self.disparity,
            "confidence": self.confidence,
            "scale": (1 / self.stride, 1 / self.stride),
            "gain": self.stride,
            "min_confidence": 0.4,
        }
        return _core.postprocess(fields | options, wanted), out


def tissue(height: int, width: int, stride: int, seed: int = 0) -> Frame:
    """A slanted wall with a nearer fold, some pixels without trust, some that are no number or out of range."""
    rng = np.random.default_rng(seed)
    h, w = -(-height // stride), -(-width // stride)
    y, x = np.mgrid[:h, :w]
    disparity = (6 + 3 * x / w + 2 * y / h + rng.normal(0, 0.05, (h, w))) / stride * 2
    disparity[h // 4 : h // 2, w // 2 : w // 2 + max(1, w // 5)] += 14 / stride
    confidence = np.clip(rng.beta(4, 1.5, (h, w)), 0, 1)
    flat = disparity.reshape(-1)
    spots = rng.choice(flat.size, min(flat.size, 6), replace=False)
    flat[spots] = np.array([np.nan, np.inf, -np.inf, 0.0, -1.0, 500.0])[: len(spots)]
    confidence.reshape(-1)[spots[:2]] = [np.nan, 1.0][: len(spots[:2])]
    return Frame(disparity.astype(np.float32), confidence.astype(np.float32), (height, width), float(stride))


def masks(size: tuple[int, int], seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    image = rng.integers(200, 256, (3, size[0] + 5, size[1] + 3)).astype(np.uint8)
    image[:, size[0] // 3 : size[0] // 2, : size[1] // 2] = 252
    left, right = np.ones((2, *size), np.uint8)
    left[:, : size[1] // 12] = 0
    right[:, size[1] - size[1] // 5 :] = 0
    return {"left": image, "valid_left": left, "valid_right": right}


SIZES = [(1, 1, 1), (2, 3, 1), (9, 130, 4), (40, 128, 8), (33, 257, 8), (31, 300, 1), (16, 500, 2)]


@every_isa
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("metric", [False, True])
@pytest.mark.parametrize("masked", [False, True])
def test_equals_twin_and_plain(isa: str, threads: int, size: tuple[int, int, int], metric: bool, masked: bool) -> None:
    frame = tissue(*size)
    options = masks(frame.size, 1) if masked else {}
    if metric:
        options |= {"focal_px": FOCAL, "baseline_mm": BASELINE, "doffs": 1.5}
        options |= {"min_depth_mm": 120.0, "max_depth_mm": 400.0, "reach": 2.0}
    else:
        options |= {"max_candidate_disparity": 30.0 / frame.stride}
    _core.set_isa(isa)
    _core.set_threads(threads)
    usable, out = frame.run(**options)
    check_against_twin(frame, usable, out, options)
    _core.set_isa("plain")
    _core.set_threads(1)
    plain_usable, plain = frame.run(**options)
    assert usable == plain_usable
    for name, values in out.items():
        np.testing.assert_array_equal(values.view(np.uint8), plain[name].view(np.uint8), err_msg=name)


def check_against_twin(frame: Frame, usable: int, out: dict[str, np.ndarray], options: dict) -> None:
    reach = options.get("reach", 1.0)
    relative = postprocess.confidence_within(frame.confidence, reach)
    for name, source, gain in (("disparity", frame.disparity, frame.stride), ("confidence", relative, 1.0)):
        with np.errstate(invalid="ignore"):
            twin = resampling.resize_bilinear(source, *frame.size, 1 / frame.stride, 1 / frame.stride, gain)
        numbers = np.isfinite(twin)
        np.testing.assert_allclose(out[name][numbers], twin[numbers], rtol=2e-4, atol=1e-4)
        assert not np.isfinite(out[name][~numbers]).any()
    # From here on the twin starts from the very floats that came out, so that the bits must agree exactly.
    metric = "focal_px" in options
    doffs = options.get("doffs", 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.float32(FOCAL * BASELINE) / (out["disparity"] + np.float32(doffs))
        bits = postprocess.reasons(
            out["disparity"],
            out["confidence"],
            min_confidence=0.4,
            image=options.get("left"),
            **{name: options.get(name) for name in ("valid_left", "valid_right")},
            depth=depth if metric else None,
            depth_range=(options.get("min_depth_mm", 0.0), options.get("max_depth_mm", np.inf)),
            doffs=doffs,
            disparity_begin=_core.range_margin * frame.stride,
            disparity_end=(options.get("max_candidate_disparity", np.inf) - 0.5) * frame.stride,
        )
    np.testing.assert_array_equal(out["reasons"], bits)
    assert usable == np.count_nonzero(bits == 0)
    if not metric:
        return
    good = bits == 0
    np.testing.assert_array_equal(out["depth"][good], depth[good])
    assert np.isnan(out["depth"][~good]).all()
    own = np.empty(frame.size, np.float32)  # the network's: sigma does not follow from the one that users see
    _core.resize_bilinear(frame.confidence, own, 1 / frame.stride, 1 / frame.stride, 1.0)
    expected = postprocess.sigma(
        depth[good].astype(float), own[good], focal_baseline=FOCAL * BASELINE, gain=frame.stride
    )
    np.testing.assert_allclose(out["sigma"][good], expected, rtol=2e-6)
    assert np.isnan(out["sigma"][~good]).all()


def test_every_reason_occurs_in_the_test_scene() -> None:
    frame = tissue(33, 257, 8)
    options = masks(frame.size, 1) | {"focal_px": FOCAL, "baseline_mm": BASELINE, "min_depth_mm": 120.0}
    _, out = frame.run(**options)
    for bit in (1, 2, 4, 8, 16):
        share = np.mean(out["reasons"] & bit != 0)
        assert 0 < share < 0.9, bit
    assert np.mean(out["reasons"] == 0) > 0.05


@every_isa
@pytest.mark.parametrize("reach", [0.25, 2 / 3, 1.0, 2.0, 8.0])
def test_confidence_within_so_many_pixels_of_the_network(isa: str, reach: float) -> None:
    _core.set_isa(isa)
    confidence = np.concatenate([np.linspace(0, 1, 4000), np.geomspace(1e-6, 1, 4000)]).astype(np.float32)[None]
    frame = Frame(np.full_like(confidence, 5), confidence, confidence.shape, 1.0)
    _, out = frame.run(reach=reach)
    expected = postprocess.confidence_within(confidence, reach)
    np.testing.assert_allclose(out["confidence"], expected, rtol=0, atol=1e-6)


@every_isa
def test_what_is_no_number_is_never_trusted(isa: str) -> None:
    _core.set_isa(isa)
    nothing = np.full((2, 40), np.nan, np.float32)
    _, out = Frame(np.full_like(nothing, 5), nothing, nothing.shape, 1.0).run(reach=2.0, min_confidence=0.0)
    assert (out["reasons"] & Reason.LOW_CONFIDENCE != 0).all()


@every_isa
def test_sigma_over_the_whole_range_of_confidence(isa: str) -> None:
    _core.set_isa(isa)
    confidence = np.concatenate([np.geomspace(1e-9, 0.5, 4000), 1 - np.geomspace(1e-9, 0.5, 4000)])
    confidence = np.concatenate([confidence, [0.0, 1.0]]).astype(np.float32)[None]
    frame = Frame(np.full_like(confidence, 5), confidence, confidence.shape, 1.0)
    usable, out = frame.run(min_confidence=0.0, focal_px=FOCAL, baseline_mm=BASELINE)
    assert usable == confidence.size - 5  # the first five matches lie left of the right view
    expected = postprocess.sigma(
        np.float64(FOCAL * BASELINE / 5), confidence[:, 5:], focal_baseline=FOCAL * BASELINE, gain=1.0
    )
    np.testing.assert_allclose(out["sigma"][:, 5:], expected, rtol=2e-6)


def test_hand_computed_pixel() -> None:
    frame = Frame(np.full((1, 20), 8, np.float32), np.full((1, 20), 0.5, np.float32), (1, 20), 1.0)
    usable, out = frame.run(focal_px=800.0, baseline_mm=5.0, doffs=2.0)
    assert usable == 12
    assert out["reasons"][0].tolist() == [4] * 8 + [0] * 12
    assert out["depth"][0, 19] == pytest.approx(400.0)
    # 400^2 / 4000 mm per px, times 1 / ln 2 px
    assert out["sigma"][0, 19] == pytest.approx(40 / np.log(2), rel=1e-6)


@every_isa
@pytest.mark.parametrize("metric", [False, True])
def test_nothing_is_found_from_half_a_pixel_before_the_end_of_the_range_on(isa: str, metric: bool) -> None:
    _core.set_isa(isa)
    network_px = np.repeat(np.array([[11.25, 11.4375, 11.5, 11.5625, 12, 12.25]], np.float32), 40, axis=1)
    frame = Frame(network_px, np.ones_like(network_px), network_px.shape, 1.0)
    options = {"focal_px": 800.0, "baseline_mm": 5.0} if metric else {}
    reached = network_px >= 11.5
    for max_candidate_disparity, expected in ((12.0, reached), (0.0, np.zeros_like(reached))):
        _, out = frame.run(max_candidate_disparity=max_candidate_disparity, **options)
        np.testing.assert_array_equal((out["reasons"] & Reason.OUT_OF_RANGE) != 0, expected)


def test_the_max_candidate_disparity_is_in_pixels_of_the_network() -> None:
    frame = Frame(np.full((2, 20), 11.25, np.float32), np.ones((2, 20), np.float32), (4, 40), 2.0)
    for max_candidate_disparity, usable in ((11.5, 0), (12.0, 4 * (40 - 23))):
        assert frame.run(max_candidate_disparity=max_candidate_disparity)[0] == usable


def test_occlusion_needs_more_than_one_pixel() -> None:
    row = np.full(40, 5, np.float32)
    row[20:25] = 6.0  # covers the match of the pixel before it by exactly one pixel: tolerated
    frame = Frame(row[None], np.ones((1, 40), np.float32), (1, 40), 1.0)
    assert not (frame.run()[1]["reasons"] & 2).any()
    row[20:25] = 9.5
    frame = Frame(row[None], np.ones((1, 40), np.float32), (1, 40), 1.0)
    occluded = np.flatnonzero(frame.run()[1]["reasons"][0] & 2)
    assert occluded.tolist() == [17, 18, 19]


def full(shape: tuple[int, ...], dtype: type = np.float32) -> np.ndarray:
    return np.zeros(shape, dtype)


METRIC = {"out": {"depth": full((8, 12))}, "focal_px": 100.0, "baseline_mm": 5.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"disparity": full((2, 3), np.float64)}, "disparity: must be float32; got float64"),
        ({"disparity": full((0, 3))}, "disparity: must not be empty"),
        ({"confidence": full((2, 4))}, "confidence: must have the size of disparity; got 4x2"),
        ({"out": {"disparity": full((8, 0))}}, "out"),
        ({"out": {"confidence": full((8, 11))}}, "confidence: must be of shape (8, 12); got (8, 11)"),
        ({"out": {"reasons": full((8, 12))}}, "reasons: must be uint8; got float32"),
        ({"left": full((3, 7, 12), np.uint8)}, "image: must be at least 12x8; got 12x7"),
        ({"left": full((8, 12, 3), np.uint8)}, "left: must have shape [3, height, width]"),
        ({"valid_left": full((8, 11), np.uint8)}, "valid_left: must be of shape (8, 12)"),
        ({"valid_right": full((8, 12), bool)}, "valid_right: must be uint8; got bool"),
        ({"min_confidence": np.nan}, "min_confidence: must be finite"),
        ({"gain": 0.0}, "gain: must be positive and finite"),
        ({"max_candidate_disparity": -1.0}, "max_candidate_disparity: must be finite and not negative"),
        ({"scale": (0.25, np.inf)}, "scale_x: must be positive and finite"),
        ({"out": {"sigma": full((8, 12))}}, "focal_px: must be positive for depth or sigma"),
        (METRIC | {"out": {"sigma": full((8, 12))}}, "depth: must be there where sigma is wanted"),
        (METRIC | {"focal_px": -1.0}, "focal_px: must be finite and not negative"),
        (METRIC | {"baseline_mm": 0.0}, "baseline_mm: must be positive and finite"),
        (METRIC | {"doffs": np.nan}, "doffs: must be finite"),
        (METRIC | {"min_depth_mm": -1.0}, "min_depth_mm: must be finite and not negative"),
        (METRIC | {"min_depth_mm": 5.0, "max_depth_mm": 5.0}, "max_depth_mm: must be greater than min_depth_mm"),
        (METRIC | {"out": {"depth": full((8, 12), np.float64)}}, "depth: must be float32"),
    ],
)
def test_bad_arguments_are_named(change: dict, message: str) -> None:
    fields = {
        "disparity": np.ones((2, 3), np.float32),
        "confidence": np.ones((2, 3), np.float32),
        "scale": (0.25, 0.25),
        "gain": 4.0,
        "min_confidence": 0.5,
    }
    out = {"disparity": full((8, 12)), "confidence": full((8, 12)), "reasons": full((8, 12), np.uint8)}
    change = dict(change)
    changed_out = out | change.pop("out", {})
    with pytest.raises(InvalidArgument, match="; got ") as caught:
        _core.postprocess(fields | change, changed_out)
    assert str(caught.value).startswith(message)
    assert _core.postprocess(fields, out) == 8 * (12 - 4)
