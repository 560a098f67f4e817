"""Calibration files that were made to do harm: each is refused with a typed error, quickly, and nothing ends."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from endosdk import StereoCalibration
from endosdk.errors import CalibrationUnreadable, InvalidArgument, InvalidCalibration, StorageFailed
from endosdk.io.bounded_read import Refused
from endosdk.io.documents import DEEPEST, parse_json, parse_opencv_xml, parse_yaml
from tests.rigs import raw_rig

DEEP = 50_000
RIG = raw_rig()

NESTED = {
    "deep.json": '{"M1": ' + "[" * DEEP + "]" * DEEP + "}",
    "deep-objects.json": '{"M1": ' * DEEP + "1" + "}" * DEEP,
    "deep.yaml": "M1: " + "[" * DEEP + "]" * DEEP,
    "deep-maps.yaml": "{a: " * DEEP + "1" + "}" * DEEP,
    "deep-blocks.yaml": "- " * DEEP + "1",
    "deep-opencv.yml": "%YAML:1.0\n---\nM1: !!opencv-matrix\n   data: " + "[" * DEEP + "]" * DEEP,
    "deep.xml": "<opencv_storage>" + "<M1>" * DEEP + "</M1>" * DEEP + "</opencv_storage>",
    "open.json": "[" * DEEP,
    "open.yaml": "[" * DEEP,
    "open.xml": "<opencv_storage>" * DEEP,
}

BOMBS = {
    "laughs.yaml": "\n".join(
        ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
        + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)]
        + ["M1: *a29"]
    ),
    "chain.yaml": "\n".join(["a0: &a0 [1]"] + [f"a{i}: &a{i} [*a{i - 1}]" for i in range(1, 2000)] + ["M1: *a1999"]),
    "itself.yaml": "M1: &a [*a]",
    "laughs.xml": '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "1111111111">'
    + "".join(f'<!ENTITY a{i} "{"&a" + str(i - 1) + ";" if i else "&a;"}{"&a;" * 9}">' for i in range(20))
    + "]><opencv_storage><M1>&a19;</M1></opencv_storage>",
    "outside.xml": '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/hostname">]><opencv_storage><M1>&a;</M1></opencv_storage>',
}

STRANGE = {
    "digits.json": '{"format": "endosdk-stereo-calibration", "version": 1, "width": ' + "9" * 5000 + "}",
    "python.yaml": "M1: !!python/object/apply:os.system ['false']",
    "date.yaml": "M1: 2001-13-45",
    "several.yaml": "M1: 1\n---\nM1: 2",
    "keys.yaml": "? [M1, M2]\n: 1",
    "bytes.yaml": "M1: !!binary ====",
    "escape.yaml": 'M1: "\\U99999999"',
    "zero.yaml": "M1: \x00",
    "empty.yaml": "",
    "empty.json": "",
    "empty.xml": "",
    "text.xml": "<opencv_storage>words</opencv_storage>",
    "other.xml": "<svg/>",
}


@pytest.mark.parametrize("name", [*NESTED, *BOMBS, *STRANGE])
def test_a_file_made_to_harm_is_refused_quickly(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text({**NESTED, **BOMBS, **STRANGE}[name])
    started = time.process_time()
    with pytest.raises(CalibrationUnreadable):
        StereoCalibration.load(path)
    assert time.process_time() - started < 5  # a tenth of it on an idle processor


def test_the_deepest_document_that_is_allowed_is_read() -> None:
    for nested in (parse_json, parse_yaml):
        value = nested("[" * DEEPEST + "]" * DEEPEST)
        for _ in range(DEEPEST - 1):
            (value,) = value
        assert value == []
        with pytest.raises(Refused, match=f"at most {DEEPEST} levels"):
            nested("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1))


def test_aliases_that_do_no_harm_are_followed() -> None:
    assert parse_yaml("a: &a [1, 2]\nb: *a\nc: &c x\nd: *c") == {"a": ["1", "2"], "b": ["1", "2"], "c": "x", "d": "x"}


@pytest.mark.parametrize("read", [parse_json, parse_yaml], ids=["json", "yaml"])
def test_a_name_stated_twice_is_refused(read) -> None:
    with pytest.raises(Refused, match="each name once; got T"):
        read('{"T": [1], "R": 2, "T": [3]}')
    with pytest.raises(Refused, match="each name once; got T"):
        parse_opencv_xml("<opencv_storage><T>1</T><T>2</T></opencv_storage>")


def test_the_encoding_that_a_document_declares_was_undone_before() -> None:
    for encoding in ("GB2312", "x-unknown"):
        text = f'<?xml version="1.0" encoding="{encoding}"?><opencv_storage><T>\u00e4</T></opencv_storage>'
        assert parse_opencv_xml(text) == {"T": "\u00e4"}


def test_an_unclosed_text_of_escapes_takes_linear_time() -> None:
    started = time.process_time()
    with pytest.raises(Refused):
        parse_json('"' + '\\"' * 1_000_000)
    assert time.process_time() - started < 5


def test_a_matrix_that_contradicts_its_size_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(
        "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 4\n   cols: 3\n   dt: d\n   data: [1,0,1,0,1,1,0,0,1]\n"
    )
    with pytest.raises(CalibrationUnreadable, match=r"rig\.yaml: M1: must hold 12 numbers, as it states; got 9"):
        StereoCalibration.load(tmp_path / "rig.yaml", layout="opencv")


@pytest.mark.parametrize("name", ["pipe", "device", "folder-of-pipe"])
def test_what_is_no_regular_file_is_never_waited_for(tmp_path: Path, name: str) -> None:
    path = Path("/dev/zero")
    if name == "pipe":
        path = tmp_path / "pipe.yaml"
        os.mkfifo(path)
    if name == "folder-of-pipe":
        path = tmp_path
        for file in ("calib.left.intrinsic.txt", "calib.l2r.txt"):
            os.mkfifo(tmp_path / file)
    with pytest.raises(CalibrationUnreadable, match=r"regular file|must hold one of"):
        StereoCalibration.load(path)


@pytest.mark.parametrize("name", ["\0", "x" * 5000, "a/" * 3000])
def test_names_that_no_system_has_are_told(name: str) -> None:
    with pytest.raises(CalibrationUnreadable, match="that exists"):
        StereoCalibration.load(name)


def test_a_name_that_is_not_utf8_is_read_like_any_other(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/rig-\xff\xfe.json"))
    RIG.save(path)
    assert StereoCalibration.load(path) == RIG


def test_saving_onto_a_device_leaves_the_device(tmp_path: Path) -> None:
    link = tmp_path / "null.json"
    link.symlink_to("/dev/null")
    with pytest.raises(StorageFailed, match="regular file"):
        RIG.save(link)
    with pytest.raises(InvalidArgument, match="must end in one of"):
        RIG.save("/dev/null")
    assert Path("/dev/null").is_char_device()
    assert link.is_symlink()


def native(tmp_path: Path, baseline_mm: float) -> Path:
    path = tmp_path / "rig.json"
    RIG.save(path)
    content = json.loads(path.read_text())
    content["translation"] = [-baseline_mm, 0.0, 0.0]
    del content["sha256"]
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize("baseline_mm", [0.0045, 4500.0])
def test_our_own_file_obeys_the_rule_of_plausible_baselines(tmp_path: Path, baseline_mm: float) -> None:
    rule = r"rig\.json: baseline: must be 0\.5 to 1000 mm, read in mm; pass units="
    with pytest.raises(InvalidCalibration, match=rule):
        StereoCalibration.load(native(tmp_path, baseline_mm))
    assert StereoCalibration.load(native(tmp_path, 4.5)).baseline_mm == 4.5


def test_whole_numbers_beyond_floats_are_typed_errors() -> None:
    with pytest.raises(InvalidCalibration):
        StereoCalibration.rectified(10**400, 4.0, (64, 48))
    with pytest.raises(InvalidCalibration):
        StereoCalibration(
            64, 48, [[10**400, 0, 0], [0, 1, 0], [0, 0, 1]], np.eye(3), np.zeros(0), np.zeros(0), np.eye(3), [-4, 0, 0]
        )


def test_a_message_has_a_bounded_length(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("{" + ", ".join(f"k{i}: 1" for i in range(20_000)) + "}")
    with pytest.raises(CalibrationUnreadable) as caught:
        StereoCalibration.load(tmp_path / "rig.yaml")
    assert len(str(caught.value)) < 1000


def test_the_command_survives_the_deep_file(tmp_path: Path) -> None:
    (tmp_path / "rig.yml").write_text(NESTED["deep-opencv.yml"])
    code = "import sys; from endosdk.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "calibrate", "convert", str(tmp_path / "rig.yml"), "--out", "x.json"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 2, done.stderr
    assert "nest" in done.stderr  # refused by our own limit, or by that of libyaml, which reads ahead of it
