"""Point clouds come back from the file as they went in."""

import numpy as np
import pytest

from endosdk import errors
from endosdk.io.point_cloud import write_ply


def read_ply(path):
    """Header lines and vertices of a binary PLY."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode("ascii").splitlines()
    kinds = {"float": "<f4", "uchar": "u1"}
    fields = [(words[2], kinds[words[1]]) for words in map(str.split, lines) if words[0] == "property"]
    return lines, np.frombuffer(body, fields)


POINTS = np.arange(36, dtype=np.float32).reshape(3, 4, 3) / 7
POINTS[1, 2] = np.nan
COLOURS = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
KNOWN = np.isfinite(POINTS).all(axis=2)


@pytest.mark.parametrize("coloured", [True, False])
def test_points_that_are_numbers_come_back(tmp_path, coloured):
    count = write_ply(tmp_path / "points.ply", POINTS, COLOURS if coloured else None)
    lines, vertices = read_ply(tmp_path / "points.ply")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert f"element vertex {count}" in lines
    assert count == vertices.size == 11
    np.testing.assert_array_equal(np.stack([vertices[a] for a in "xyz"], axis=1), POINTS[KNOWN])
    assert coloured == ("red" in vertices.dtype.names)
    if coloured:
        colours = np.stack([vertices[c] for c in ("red", "green", "blue")], axis=1)
        np.testing.assert_array_equal(colours, COLOURS[KNOWN])


def test_bad_input_is_refused(tmp_path):
    with pytest.raises(errors.InvalidArgument, match="points"):
        write_ply(tmp_path / "p.ply", POINTS[..., :2])
    with pytest.raises(errors.InvalidArgument, match="colours"):
        write_ply(tmp_path / "p.ply", POINTS, COLOURS[:2])
    with pytest.raises(errors.InvalidArgument, match="points: must be a NumPy array; got NoneType"):
        write_ply(tmp_path / "p.ply", None, None)
    with pytest.raises(errors.InvalidArgument, match="colours: must be a NumPy array; got list"):
        write_ply(tmp_path / "p.ply", POINTS, COLOURS.tolist())
    with pytest.raises(errors.InvalidArgument, match="path: must be a file name; got None"):
        write_ply(None, POINTS)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(errors.StorageFailed, match="path"):
        write_ply(tmp_path / "no" / "p.ply", POINTS)
