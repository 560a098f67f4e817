"""The compiled PatchMatch against slow NumPy twins of its parts, and on planes whose answer is known."""

import ctypes
import platform

import numpy as np
import pytest

from benchmarks.methods.patchmatch import PatchMatchSettings, built_in, cmake_program, library, match, pointer
from endosdk.errors import InvalidArgument
from tests.conftest import shifted_pair, textured_picture

pytestmark = pytest.mark.skipif(cmake_program() is None, reason="Debian: apt-get install cmake g++")


def twin_cost(left, right, x, y, plane, radius, max_disparity):
    """Section 3.1 of the paper, pixel by pixel."""
    weights = np.array([0.299, 0.587, 0.114])
    height, width = left.shape[:2]
    gradients = []
    for view in (left, right):
        gray = np.pad(view @ weights, ((0, 0), (1, 1)), mode="edge")
        gradients.append((gray[:, 2:] - gray[:, :-2]) / 2)
    left, right = left.astype(np.float64), right.astype(np.float64)
    total = 0.0
    for v in range(max(0, y - radius), min(height, y + radius + 1)):
        for u in range(max(0, x - radius), min(width, x + radius + 1)):
            weight = np.exp(-np.abs(left[v, u] - left[y, x]).sum() / 10)
            disparity = plane[0] * u + plane[1] * v + plane[2]
            place = u - disparity
            cost = 0.1 * 10 + 0.9 * 2
            if 0 <= disparity <= max_disparity and 0 <= place <= width - 1:
                first = min(int(place), width - 2)
                share = place - first
                colour = (1 - share) * right[v, first] + share * right[v, first + 1]
                gradient = (1 - share) * gradients[1][v, first] + share * gradients[1][v, first + 1]
                cost = 0.1 * min(np.abs(left[v, u] - colour).sum(), 10)
                cost += 0.9 * min(abs(gradients[0][v, u] - gradient), 2)
            total += weight * cost
    return total


@pytest.fixture(scope="module", params=["native", "plain"])
def kernels(request, tmp_path_factory):
    """The library as it is built here, and with the loops of processors without AVX-512."""
    if request.param == "native":
        return library()
    if platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("the native build has no other loops: only an x86-64 processor has them")
    return built_in(tmp_path_factory.mktemp("plain"), "-DCMAKE_CXX_FLAGS=-mno-avx512f")


# The last window is several registers wide, and so steep that its matches lie far apart.
@pytest.mark.parametrize(("x", "y"), [(15, 9), (0, 0), (59, 19), (7, 18)])
@pytest.mark.parametrize(
    ("plane", "radius"),
    [((0.0, 0.0, 4.3), 6), ((0.1, -0.05, 3.0), 17), ((-0.41, 0.2, 8.1), 17), ((-1.5, 0.2, 30.0), 17)],
)
def test_cost_of_a_plane_is_that_of_the_twin(kernels, x, y, plane, radius):
    left, right = shifted_pair(20, 60, 4)
    found = kernels.patchmatch_cost(
        pointer(left), pointer(right), 20, 60, x, y, pointer(np.array(plane, np.float32)), radius, 40
    )
    assert found == pytest.approx(twin_cost(left, right, x, y, plane, radius, 40), rel=1e-4)


def twin_fill(left, disparity, checked, radius):
    """Section 3.4: the smaller of the nearest valid values of the row, then the weighted median where it was filled."""
    height = checked.shape[0]
    rough = checked.copy()
    for y in range(height):
        known = np.flatnonzero(np.isfinite(checked[y]))
        for x in np.flatnonzero(~np.isfinite(checked[y])):
            sides = [known[known < x][-1:], known[known > x][:1]]
            values = [disparity[y, side[0]] for side in sides if side.size]
            rough[y, x] = min(values) if values else disparity[y, x]
    out = rough.copy()
    colours = left.astype(np.float64)
    for y, x in np.argwhere(~np.isfinite(checked)):
        rows = slice(max(0, y - radius), y + radius + 1)
        columns = slice(max(0, x - radius), x + radius + 1)
        weights = np.exp(-np.abs(colours[rows, columns] - colours[y, x]).sum(-1) / 10).ravel()
        values = rough[rows, columns].ravel()
        order = np.argsort(values, kind="stable")
        sums = np.cumsum(weights[order])
        out[y, x] = values[order][np.searchsorted(sums, 0.5 * sums[-1])]
    return out


def test_fill_and_weighted_median_are_those_of_the_twin():
    rng = np.random.default_rng(5)
    left = textured_picture(18, 26)
    disparity = rng.uniform(1, 10, (18, 26)).astype(np.float32)
    checked = np.where(rng.uniform(size=(18, 26)) < 0.3, np.float32(np.nan), disparity).astype(np.float32)
    checked[4] = np.nan  # a row without any valid pixel
    checked[7, :9], checked[9, 15:] = np.nan, np.nan
    filled = np.empty_like(checked)
    library().patchmatch_fill(pointer(left), 18, 26, 4, 12, pointer(disparity), pointer(checked), pointer(filled))
    assert np.allclose(filled, twin_fill(left, disparity, checked, 4), atol=1e-6)


def slanted_pair(height, width):
    """Views of a plane with disparity 4 + 0.08 x + 0.03 y, the left one sampled from the right."""
    import cv2

    right = textured_picture(height, width, 2)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    truth = 4 + 0.08 * x + 0.03 * y
    left = cv2.remap(right, x - truth, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    return left, right, truth


def test_slanted_plane_is_found_to_a_fraction_of_a_pixel():
    left, right, truth = slanted_pair(48, 80)
    settings = PatchMatchSettings(max_disparity=16, radius=8, threads=2)
    checked, filled = match(left, right, settings)
    inside = np.s_[4:-4, 16:-4]
    known = np.isfinite(checked[inside])
    assert known.mean() > 0.9
    assert np.median(np.abs(checked - truth)[inside][known]) < 0.05
    assert np.isfinite(filled).all()
    assert np.array_equal(filled[np.isfinite(checked)], checked[np.isfinite(checked)])


def test_answer_does_not_depend_on_the_number_of_threads():
    left, right, _ = slanted_pair(24, 40)
    answers = [
        match(left, right, PatchMatchSettings(max_disparity=16, radius=4, rounds=2, threads=count))
        for count in (1, 2, 5)
    ]
    for other in answers[1:]:
        for found, expected in zip(other, answers[0], strict=True):
            assert np.array_equal(found, expected, equal_nan=True)


def test_views_of_other_shapes_and_windows_that_are_too_large_are_refused():
    left, right, _ = slanted_pair(24, 40)
    with pytest.raises(InvalidArgument, match="left"):
        match(left, right[:-1])
    with pytest.raises(InvalidArgument, match="radius"):
        match(left, right, PatchMatchSettings(radius=40))


def test_settings_have_the_layout_of_the_compiled_ones():
    from benchmarks.methods.patchmatch import _Settings

    assert ctypes.sizeof(_Settings) == 24 and _Settings.seed.offset == 16
