"""What C measures is what Python measures."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, byref, c_double, c_int32, c_size_t, c_uint32

import numpy as np
import pytest

from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.measure import (
    area,
    path_length,
    point_at,
    points_in_raw_left_camera,
    q_matrix,
    raw_to_rectified,
    rectified_to_raw,
    valid_region,
)
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

PIXELS = np.array([(30.0, 20.0), (120.0, 40.0), (110.0, 80.0)])


class Measured(ctypes.Structure):
    _fields_ = (("struct_size", c_uint32), ("reserved", c_int32), ("value", c_double), ("standard_error", c_double))


class Point(ctypes.Structure):
    _fields_ = (
        ("struct_size", c_uint32),
        ("reserved", c_int32),
        ("xyz", c_double * 3),
        ("covariance", c_double * 9),
    )


class Area(ctypes.Structure):
    _fields_ = (
        ("struct_size", c_uint32),
        ("reserved", c_int32),
        *((name, c_double) for name in ("flat", "flat_error", "relief", "relief_error", "coverage")),
    )


class Rectification(ctypes.Structure):
    _fields_ = (
        ("struct_size", c_uint32),
        ("region", c_int32 * 4),
        ("reserved", c_int32),
        *((name, c_double * count) for name, count in (("R1", 9), ("R2", 9), ("P1", 12), ("P2", 12), ("q", 16))),
    )


def made(kind):
    return kind(struct_size=ctypes.sizeof(kind))


def doubles(values: np.ndarray):
    return np.ascontiguousarray(values, np.float64).ctypes.data_as(POINTER(c_double))


@pytest.fixture
def measured() -> tuple[StereoCalibration, DepthResult, c.Result]:
    """A slanted surface with a known error, as Python's result and as C's."""
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    found = DepthEstimator(str(TINY_MODEL), calibration=rig).predict(*shifted_pair(96, 160, 10))
    y, x = np.mgrid[:96, :160].astype(np.float32)
    found.depth[...], found.sigma[...], found.reasons[...] = 80 + 0.1 * x - 0.05 * y, 0.5 + 0.001 * x, 0
    result = c.Result(struct_size=ctypes.sizeof(c.Result), capacity=160 * 96)
    for name in ("depth", "sigma", "reasons"):
        setattr(result, name, getattr(found, name).ctypes.data)
    return rig, found, result


def test_points_lengths_and_areas(library, measured):
    rig, found, result = measured
    numbers = c.Calibration.of(rig)
    point, length, inside = made(Point), made(Measured), made(Area)
    assert library.endo_point_at(byref(numbers), byref(result), c_double(30), c_double(20), byref(point)) == 0
    expected = point_at(found, 30, 20)
    assert list(point.xyz) == pytest.approx(expected.xyz)
    assert list(point.covariance) == pytest.approx(expected.covariance.ravel())
    count = c_size_t(len(PIXELS))
    assert library.endo_path_length(byref(numbers), byref(result), doubles(PIXELS), count, byref(length)) == 0
    wanted = path_length(found, PIXELS)
    assert (length.value, length.standard_error) == pytest.approx((wanted.value, wanted.standard_error))
    assert library.endo_area_inside(byref(numbers), byref(result), doubles(PIXELS), count, byref(inside)) == 0
    surface = area(found, PIXELS)
    assert (inside.flat, inside.flat_error) == pytest.approx((surface.flat.value, surface.flat.standard_error))
    assert (inside.relief, inside.coverage) == pytest.approx((surface.relief.value, 1.0))


def test_what_cannot_be_measured_is_refused(library, measured):
    rig, _, result = measured
    numbers, point = c.Calibration.of(rig), made(Point)
    assert library.endo_point_at(byref(numbers), byref(result), c_double(160), c_double(20), byref(point)) == 1
    assert b"160x96" in library.endo_last_error()
    result.sigma = None
    assert library.endo_point_at(byref(numbers), byref(result), c_double(30), c_double(20), byref(point)) == 1
    assert b"result.sigma" in library.endo_last_error()
    length = made(Measured)
    line = np.linspace((5, 5), (150, 90), 10001)
    assert (
        library.endo_path_length(byref(numbers), byref(result), doubles(line), c_size_t(len(line)), byref(length)) == 1
    )
    assert b"at most 10000" in library.endo_last_error()
    point.struct_size = 8
    assert library.endo_point_at(byref(numbers), byref(result), c_double(30), c_double(20), byref(point)) == 1
    assert b"point.struct_size" in library.endo_last_error()


def test_a_result_that_no_call_would_write_is_not_read(library, measured):
    rig, _, result = measured
    numbers, point, length, inside = c.Calibration.of(rig), made(Point), made(Measured), made(Area)
    outline = doubles(PIXELS), c_size_t(len(PIXELS))

    def refused(rule: bytes, **changes: int) -> None:
        bad = c.Result.from_buffer_copy(result)
        for name, value in changes.items():
            setattr(bad, name, value)
        head = byref(numbers), byref(bad)
        for status in (
            library.endo_point_at(*head, c_double(30), c_double(20), byref(point)),
            library.endo_path_length(*head, *outline, byref(length)),
            library.endo_area_inside(*head, *outline, byref(inside)),
        ):
            assert (status, rule in library.endo_last_error()) == (1, True), library.endo_last_error()

    refused(b"depth: must be aligned to 4 bytes; got 1 too far", depth=result.depth + 1)
    refused(b"sigma: must be aligned to 4 bytes; got 2 too far", sigma=result.sigma + 2)
    refused(b"must not lie in the memory of", reasons=result.depth)
    refused(b"result.reserved: must be 0; got 1", reserved=1)
    refused(b"result.reserved2: must be 0; got -1", reserved2=-1)


def test_a_rig_whose_pixels_are_not_square_has_all_but_q(library):
    matrix = np.array([[800.0, 0, 479.5], [0, 400.0, 179.5], [0, 0, 1]])
    cameras = {f"{side}_matrix": matrix for side in ("left", "right")}
    cameras |= {f"{side}_distortion": np.zeros(5) for side in ("left", "right")}
    rig = StereoCalibration(width=960, height=360, rotation=np.eye(3), translation=np.array([-5.0, 0, 0]), **cameras)
    estimator = c.CEstimator(library, TINY_MODEL, rig)
    geometry = estimator.geometry()
    estimator.close()
    assert (geometry.focal_px, geometry.focal_y_px) == pytest.approx((800, 400))
    numbers, rectification = c.Calibration.of(rig), made(Rectification)
    assert library.endo_get_rectification(byref(numbers), c_double(0), byref(rectification)) == 0
    assert np.isnan(rectification.q).all()
    assert tuple(rectification.region) == valid_region(rig)
    assert list(rectification.P1) == pytest.approx(rig.rectification().P1.ravel())


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_pixels_both_ways_q_and_region(library, alpha):
    rig = raw_rig()
    numbers, rectification, out = c.Calibration.of(rig), made(Rectification), np.empty_like(PIXELS)
    assert library.endo_get_rectification(byref(numbers), c_double(alpha), byref(rectification)) == 0
    assert tuple(rectification.region) == valid_region(rig, alpha=alpha)
    geometry = rig.rectification(alpha=alpha)
    assert list(rectification.q) == pytest.approx(q_matrix(geometry).ravel())
    assert list(rectification.P2) == pytest.approx(geometry.P2.ravel())
    for function, twin in (
        (library.endo_raw_to_rectified, raw_to_rectified),
        (library.endo_rectified_to_raw, rectified_to_raw),
    ):
        for right, side in enumerate(("left", "right")):
            words = c_double(alpha), c_int32(right), doubles(PIXELS), c_size_t(len(PIXELS)), doubles(out)
            assert function(byref(numbers), *words) == 0
            assert out == pytest.approx(twin(rig, PIXELS, side, alpha=alpha))
    points, raw = np.array([(3.0, 4.0, 60.0)]), np.empty((1, 3))
    assert library.endo_to_raw_left(byref(numbers), doubles(points), c_size_t(1), doubles(raw)) == 0
    assert raw == pytest.approx(points_in_raw_left_camera(rig.rectification(), points))
