"""Measure in a result, in mm with standard errors, and turn its points into other frames of reference.

    from endosdk.measure import distance
    size = distance(result, (310, 200), (388, 214))
    print(size)  # 12.41 mm, 95 % within 12.02 .. 12.80

Pixels are (x, y) of the result's maps: those of the rectified left view, (0, 0) at the centre of the first pixel.
"""

from endosdk.measure.areas import Area, area
from endosdk.measure.geometry import (
    points_in_raw_left_camera,
    q_matrix,
    raw_to_rectified,
    rectified_to_raw,
    valid_region,
)
from endosdk.measure.lengths import Measured, Point, distance, path_length, point_at
from endosdk.measure.raw_left_view import RawLeftView

__all__ = [
    "Area",
    "Measured",
    "Point",
    "RawLeftView",
    "area",
    "distance",
    "path_length",
    "point_at",
    "points_in_raw_left_camera",
    "q_matrix",
    "raw_to_rectified",
    "rectified_to_raw",
    "valid_region",
]
