"""Rig files in the C library: what Python writes, and what must be refused."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import endosdk
from tests.c_library import binding as c
from tests.c_library.test_answers import RIGS
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig


def read(library: ctypes.CDLL, text: bytes) -> c.Calibration:
    """Read the text of a rig file; a failure leaves the struct as it was."""
    calibration = c.Calibration(struct_size=ctypes.sizeof(c.Calibration), width=7)
    status = library.endo_read_calibration(text, len(text), ctypes.byref(calibration))
    if status:
        assert calibration.width == 7
        raise c.CError(status, library)
    return calibration


@pytest.mark.parametrize("name", [name for name in RIGS if name != "no rig"])
def test_reads_what_python_writes(library: ctypes.CDLL, tmp_path: Path, name: str) -> None:
    rig = RIGS[name]()
    assert rig is not None
    rig.save(tmp_path / "rig.json")
    found = read(library, (tmp_path / "rig.json").read_bytes())
    assert bytes(found) == bytes(c.Calibration.of(rig))


def test_an_estimator_takes_it_and_says_the_same_hash(library: ctypes.CDLL, tmp_path: Path) -> None:
    rig = raw_rig()
    rig.save(tmp_path / "rig.json")
    estimator = c.CEstimator(library, TINY_MODEL)
    calibration = read(library, (tmp_path / "rig.json").read_bytes())
    assert library.endo_set_calibration(estimator.handle, ctypes.byref(calibration)) == 0
    result, _ = estimator.predict(*shifted_pair(rig.height, rig.width, 11), maps=("depth",))
    estimator.close()
    assert result.identity.calibration_sha256.decode() == rig.sha256


def test_arguments_that_cannot_be_are_refused(library: ctypes.CDLL, tmp_path: Path) -> None:
    raw_rig().save(tmp_path / "rig.json")
    text = (tmp_path / "rig.json").read_bytes()
    calibration = c.Calibration(struct_size=8)
    assert library.endo_read_calibration(text, len(text), ctypes.byref(calibration)) == 1
    assert library.endo_read_calibration(None, 0, ctypes.byref(calibration)) == 1
    assert library.endo_read_calibration(text, len(text), None) == 1


def changed(**fields: Any) -> Callable[[dict[str, Any]], object]:
    return lambda content: content.update(fields)


def without(name: str) -> Callable[[dict[str, Any]], object]:
    return lambda content: content.pop(name)


def of_left(**fields: Any) -> Callable[[dict[str, Any]], object]:
    return lambda content: content["left"].update(fields)


UNREADABLE = {
    "format": (changed(format="another"), "format: must be endosdk-stereo-calibration"),
    "no format": (without("format"), "format: must be there"),
    "version": (changed(version=2), "version: must be 1"),
    "units": (changed(units="m"), "units: must be mm"),
    "model": (changed(model="plenoptic"), "model: must be pinhole or fisheye"),
    "model of another type": (changed(model=3), "model: must be a plain string"),
    "width": (changed(width=640.5), "width: must be a whole number"),
    "height as text": (changed(height="480"), "height: must be a whole number"),
    "no width": (without("width"), "width: must be there"),
    "rotation": (changed(rotation=[1, 0, 0]), "rotation: must hold 9 numbers"),
    "rotation of texts": (changed(rotation=["a"] * 9), "rotation: must hold numbers"),
    "rotation too deep": (changed(rotation=[[[[1]]]]), "rotation: must hold numbers"),
    "left": (changed(left=[1]), "left: must be a JSON object"),
    "matrix": (of_left(matrix=[[1, 2], [3, 4]]), "left matrix: must hold 9 numbers"),
    "distortion": (of_left(distortion=[0] * 14), "left distortion: must hold at most 8 numbers"),
    "field of view": (of_left(field_of_view=[1, 2, 3]), "left field_of_view: must hold 4 numbers"),
    "hash": (changed(sha256="0" * 64), "must be the hash of the content"),
    "content": (changed(width=648), "must be the hash of the content"),
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_another_file_is_refused(library: ctypes.CDLL, name: str) -> None:
    content = rig_file()
    change, message = UNREADABLE[name]
    change(content)
    with pytest.raises(c.CError, match=message) as refused:
        read(library, json.dumps(content).encode())
    assert refused.value.name == "CALIBRATION_UNREADABLE"


def rig_file() -> dict[str, Any]:
    rig = raw_rig()
    return {"format": "endosdk-stereo-calibration", "version": 1, **rig.content(), "sha256": rig.sha256}


@pytest.mark.parametrize(
    "text", [b"", b"{", b"[]", b"null", b"{}x", b'{"format": 1, "format": 1}', b"\xff" * 9, b" " * (2 << 20)]
)
def test_what_is_no_object_is_refused(library: ctypes.CDLL, text: bytes) -> None:
    with pytest.raises(c.CError) as refused:
        read(library, text)
    assert refused.value.name == "CALIBRATION_UNREADABLE"


def test_every_cut_is_refused(library: ctypes.CDLL) -> None:
    text = json.dumps(rig_file()).encode()
    read(library, text)
    for end in range(len(text)):
        with pytest.raises(c.CError):
            read(library, text[:end])


def test_a_file_edited_by_hand_needs_no_hash(library: ctypes.CDLL) -> None:
    content = rig_file()
    del content["sha256"]
    content["left"]["field_of_view"] = None
    content["note"] = {"who": ["a surgeon"], "when": 2026}
    content["width"] = 648
    assert read(library, json.dumps(content, indent=3).encode()).width == 648


def test_numbers_that_no_rig_has_are_refused_as_in_python(library: ctypes.CDLL, tmp_path: Path) -> None:
    for change in ({"translation": [-0.004, 0, 0]}, {"rotation": np.diag([1, 1, -1]).tolist()}):
        content = rig_file() | change
        del content["sha256"]
        with pytest.raises(c.CError) as refused:
            read(library, json.dumps(content).encode())
        assert refused.value.name == "INVALID_CALIBRATION"
        (tmp_path / "rig.json").write_text(json.dumps(content))
        with pytest.raises(endosdk.errors.InvalidCalibration):
            endosdk.StereoCalibration.load(tmp_path / "rig.json")
