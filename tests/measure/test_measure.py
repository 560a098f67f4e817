"""Lengths and areas with standard errors, against rendered truth and against sums by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from endosdk import DepthEstimator, DepthResult, StereoCalibration, _core
from endosdk.datasets.dataset import read_disparity
from endosdk.errors import CalibrationRequired, InvalidArgument
from endosdk.io.pictures import read_frame
from endosdk.measure import area, distance, path_length, point_at
from endosdk.runtime.result import Reason
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.reference import measure as twin

DEMO = ROOT / "examples" / "data"


@pytest.fixture(scope="module")
def demo() -> tuple[DepthResult, DepthResult]:
    """The answer for the rendered pair, and the same with the true depth in its place."""
    rig = StereoCalibration.load(DEMO / "rig.json")
    estimator = DepthEstimator("fast", calibration=rig)
    result = estimator.predict(read_frame(DEMO / "demo" / "left.png"), read_frame(DEMO / "demo" / "right.png"))
    return result, with_truth(result, read_disparity(DEMO / "demo" / "disparity.png"))


def with_maps(result: DepthResult, **maps: np.ndarray) -> DepthResult:
    return replace(result, maps=result.maps._replace(**maps))


def with_truth(result: DepthResult, disparity: np.ndarray) -> DepthResult:
    g = result.geometry
    assert g is not None
    true = (g.focal_px * g.baseline_mm / (disparity + g.doffs)).astype(np.float32)
    return with_maps(result, depth=np.where(np.isfinite(result.depth), true, np.nan))


@pytest.fixture(scope="module")
def plane() -> DepthResult:
    """A plane straight ahead, 100 mm away: 200 px focal length, 5 mm baseline, 10 px."""
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    result = DepthEstimator(str(TINY_MODEL), calibration=rig).predict(*shifted_pair(96, 160, 10))
    depth = np.full_like(result.depth, 100.0)
    return with_maps(result, depth=depth, sigma=np.full_like(depth, 0.5), reasons=np.zeros_like(result.reasons))


def interval_hits(result, truth, lengths, count=300, seed=1):
    """Share of random distances whose 95 % interval holds the true one."""
    rng = np.random.default_rng(seed)
    rows, columns = np.nonzero(np.isfinite(result.depth) & np.isfinite(truth.depth))
    hits = []
    while len(hits) < count:
        i = rng.integers(len(rows))
        p = int(columns[i]), int(rows[i])
        turn, far = rng.uniform(0, 2 * np.pi), rng.uniform(*lengths)
        q = round(p[0] + far * np.cos(turn)), round(p[1] + far * np.sin(turn))
        try:
            found, true = distance(result, p, q), distance(truth, p, q)
        except InvalidArgument:  # outside, or without depth
            continue
        hits.append(found.interval[0] <= true.value <= found.interval[1])
    return float(np.mean(hits))


def test_intervals_hold_the_true_distances_of_a_rendered_scene(demo):
    # The confidence has learned on spoilt pairs: on a clean one its intervals are wide.
    assert 0.90 <= interval_hits(*demo, lengths=(20, 250)) <= 0.998


def test_intervals_hold_the_true_areas_of_a_rendered_scene(demo):
    result, truth = demo
    rng = np.random.default_rng(2)
    hits = []
    while len(hits) < 40:
        middle, radius = rng.uniform((100, 100), (860, 620)), rng.uniform(20, 80)
        outline = [
            tuple(middle + radius * np.array([np.cos(a), np.sin(a)])) for a in np.linspace(0, 2 * np.pi, 12)[:-1]
        ]
        try:
            found = area(result, outline)
        except InvalidArgument:  # without depth
            continue
        if found.coverage > 0.9:
            low, high = found.flat.interval
            hits.append(low <= area(truth, outline).flat.value <= high)
    assert np.mean(hits) >= 0.85


def test_lengths_and_areas_equal_their_twins(demo):
    result, _ = demo
    rows, columns = np.nonzero(np.isfinite(result.depth))
    rng = np.random.default_rng(5)
    for count in (2, 3, 9):
        some = rng.integers(len(rows), size=count)
        pixels = np.column_stack([columns[some], rows[some]]) + rng.uniform(-0.4, 0.4, (count, 2))
        found = path_length(result, pixels)
        assert (found.value, found.standard_error) == pytest.approx(twin.path_length(result, pixels), rel=1e-9)
    for corners in (
        [(300, 200), (380.5, 210), (350, 290.5)],
        [(500, 300), (560, 300), (530, 330), (560, 360), (500, 360)],
    ):
        found = area(result, corners)
        numbers = (found.flat.value, found.flat.standard_error, found.relief.value, found.relief.standard_error)
        assert (*numbers, found.coverage) == pytest.approx(twin.area(result, corners), rel=1e-5)


def test_points_lie_where_the_result_puts_them(demo):
    result, _ = demo
    rows, columns = np.nonzero(np.isfinite(result.depth))
    for i in range(0, len(rows), len(rows) // 20):
        point = point_at(result, columns[i], rows[i])
        # Near the axis little is left of two numbers of seven digits: 1e-4 mm is what these may round away.
        assert point.xyz == pytest.approx(result.points()[rows[i], columns[i]], rel=1e-5, abs=1e-4)
        assert point.depth.standard_error == pytest.approx(2**0.5 * float(result.sigma[rows[i], columns[i]]), rel=1e-6)
        assert np.linalg.matrix_rank(point.covariance, tol=1e-9) == 1  # all of the error is along the line of sight


def test_a_distance_along_the_plane_by_hand(plane):
    found = distance(plane, (40, 40), (80, 40))
    assert found.value == pytest.approx(40 * 100 / 200)
    assert found.unit == "mm"
    low, high = found.interval
    assert low < found.value < high
    assert "95 % within" in str(found)


def test_a_pixel_that_is_named_twice_adds_no_error(plane):
    once, twice = path_length(plane, [(40, 40), (80, 40)]), path_length(plane, [(40, 40), (40, 40), (80, 40), (80, 40)])
    assert (twice.value, twice.standard_error) == pytest.approx((once.value, once.standard_error))


def test_errors_of_a_distance_equal_those_of_drawn_depths(plane):
    # Depths drawn with the stated errors and correlation: the lengths spread as far as the standard error says.
    pixels = [(30, 30), (50, 34), (52, 60)]
    length_px = _core.correlation_share * 160
    apart = np.hypot(*(np.subtract.outer(values, values) for values in np.array(pixels).T))
    variance = 2 * 0.5**2  # of a Laplace law whose scale is the plane's sigma
    drawn = np.random.default_rng(0).multivariate_normal(
        [100.0] * 3, variance * _core.mean_square_share * np.exp(-apart / length_px), 4000
    )
    rays = np.array([((x - 79.5) / 200, (y - 47.5) / 200, 1) for x, y in pixels])
    points = drawn[..., None] * rays
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    assert path_length(plane, pixels).standard_error == pytest.approx(lengths.std(), rel=0.1)


def test_area_of_a_square_on_the_plane(plane):
    found = area(plane, [(40, 30), (80, 30), (80, 60), (40, 60)])
    assert found.flat.value == pytest.approx(20 * 15, rel=1e-6)
    assert found.flat.unit == "mm²"
    assert found.relief.value == pytest.approx(0, abs=1e-3)
    assert found.coverage == 1
    # All depths too large by their standard error would make it larger by 2 * 0.5 %; some of that averages out.
    assert 0.2 < found.flat.standard_error / (20 * 15 * 0.01) < 1.5


def test_an_outline_that_crosses_itself_is_refused(plane):
    with pytest.raises(InvalidArgument, match=r"^polygon: must not cross itself; got lines 0 and 2"):
        area(plane, [(40, 30), (80, 60), (80, 30), (40, 60)])
    with pytest.raises(InvalidArgument, match=r"^polygon: must be 3 to 10000 pixels"):
        area(plane, [(40, 30), (80, 30)])


@pytest.mark.parametrize(
    "outline",
    [
        [(40, 30), (80, 70), (80, 30), (60, 50), (40, 70)],  # a corner on a line
        [(40, 30), (60, 50), (80, 70), (80, 30), (60, 50), (40, 70)],  # two corners at one place
    ],
)
def test_an_outline_that_crosses_itself_at_a_corner_is_refused(plane, outline):
    for turned in range(len(outline)):
        for way in (outline, outline[::-1]):
            with pytest.raises(InvalidArgument, match=r"^polygon: must not cross itself; got line \d and corner \d"):
                area(plane, way[turned:] + way[:turned])


@pytest.mark.parametrize(
    "outline",
    [
        [(40, 30), (80, 30), (80, 60), (40, 60), (40, 30)],  # closed
        [(40, 30), (80, 30), (80, 30), (80, 60), (40, 60)],  # a corner twice
        [(40, 30), (80, 30), (80, 60), (60, 60), (60, 30), (60, 60), (40, 60)],  # out and back to the other side
    ],
)
def test_an_outline_that_touches_itself_has_an_area(plane, outline):
    assert area(plane, outline).flat.value == pytest.approx(20 * 15, rel=1e-6)


def test_an_outline_with_a_hole_has_the_area_between(plane):
    hole = [(50, 40), (50, 50), (60, 50), (60, 40), (50, 40)]
    found = area(plane, [(40, 30), *hole, (40, 30), (80, 30), (80, 60), (40, 60)])
    assert found.flat.value == pytest.approx(20 * 15 - 5 * 5, rel=1e-6)


def test_the_plane_is_fitted_to_the_whole_of_an_outline_of_any_height():
    """Of 600 rows, one pixel each is taken. They must not be one column: noise would tilt a plane along it."""
    rig = StereoCalibration.rectified(focal_px=400.0, baseline_mm=5.0, size=(800, 640))
    result = DepthEstimator(str(TINY_MODEL), calibration=rig).predict(*shifted_pair(640, 800, 10))
    depth = np.random.default_rng(1).normal(100, 0.5, result.depth.shape).astype(np.float32)
    wall = with_maps(result, depth=depth, sigma=np.full_like(depth, 0.5), reasons=np.zeros_like(result.reasons))
    for height in (590, 599, 600):
        found = area(wall, [(20, 20), (780, 20), (780, 20 + height), (20, 20 + height)])
        assert found.flat.value == pytest.approx(760 * height / 16, rel=1e-3)
        assert found.relief.value == pytest.approx(2 * 1.96 * 0.5, rel=0.02)


def receding(plane, corner):
    """A floor that recedes to the right, whose depth is not known beyond a column, and an outline up to a corner."""
    depth = np.full_like(plane.depth, np.nan)
    depth[:, :40] = 1.0 / (0.05 - 0.001 * np.arange(40))  # its horizon is column 50
    result = with_maps(plane, depth=depth, sigma=np.where(np.isnan(depth), np.nan, 0.002 * depth).astype(np.float32))
    return area(result, [(2, 20), (corner, 20), (corner, 70), (2, 70)])


def test_an_outline_over_the_horizon_of_its_plane_is_refused(plane):
    areas = [receding(plane, corner).flat.value for corner in (30, 39, 44)]
    assert areas == sorted(areas)
    for corner in (50, 60, 75):  # half of it has depth, and its lines of sight never meet the plane
        with pytest.raises(InvalidArgument, match=rf"^polygon: must end before the horizon .*the corner {corner}, "):
            receding(plane, corner)


def test_a_line_has_at_most_as_many_pixels_as_a_polygon(plane):
    with pytest.raises(InvalidArgument, match=r"^pixels: must be two or more, and at most 10000; got 10001"):
        path_length(plane, [(40, 40)] * 10_001)


def test_relief_of_a_step(plane):
    depth = plane.depth.copy()
    depth[40:50, 50:70] -= 4
    found = area(with_maps(plane, depth=depth), [(40, 30), (80, 30), (80, 60), (40, 60)])
    assert found.relief.value == pytest.approx(4, abs=0.6)


def test_pixels_without_depth_are_refused_with_the_reason(plane):
    depth, reasons = plane.depth.copy(), plane.reasons.copy()
    depth[20, 20], reasons[20, 20] = np.nan, Reason.SATURATED
    result = with_maps(plane, depth=depth, reasons=reasons)
    with pytest.raises(InvalidArgument, match="SATURATED"):
        point_at(result, 20, 20)
    with pytest.raises(InvalidArgument, match="160x96"):
        distance(result, (10, 10), (160, 10))
    with pytest.raises(InvalidArgument, match="two or more"):
        path_length(result, [(1, 1)])
    with pytest.raises(InvalidArgument, match="must be 3 to 10000 pixels"):
        area(result, [(1, 1), (5, 5)])
    with pytest.raises(InvalidArgument, match="30 pixels"):
        area(result, [(1, 1), (3, 1), (3, 3)])
    unseen = depth.copy()
    unseen[30:60, 40:65] = np.nan
    with pytest.raises(InvalidArgument, match=r"on half of its pixels or more; got 0\.3"):
        area(with_maps(plane, depth=unseen), [(40, 30), (80, 30), (80, 60), (40, 60)])
    with pytest.raises(InvalidArgument, match="one line"):
        area(result, [(1, 9.5), (100, 9.5), (100, 10.5), (1, 10.5)])
    with pytest.raises(InvalidArgument, match=r"list of \(x, y\)"):
        area(result, [1, 2, 3])


def test_measuring_needs_a_rig():
    result = DepthEstimator(str(TINY_MODEL)).predict(*shifted_pair(64, 96, 8))
    with pytest.raises(CalibrationRequired):
        point_at(result, 5, 5)
