"""How every verb behaves: help, exit status, JSON, pipes, missing dependencies, completion."""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import pty
import shlex
import shutil
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk import StereoCalibration
from endosdk.commands.cli import EXAMPLES, VERBS, build_parser, main
from endosdk.io.extras import dependency_missing, extra_of, install_command
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

RUN = [sys.executable, "-m", "endosdk"]


def leaves(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parsers that take a user's last words."""
    below = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not below:
        yield parser
    for action in below:
        for one in action.choices.values():
            yield from leaves(one)


@pytest.fixture(scope="module")
def parsers() -> list[argparse.ArgumentParser]:
    return list(leaves(build_parser(VERBS)))


@pytest.fixture
def pair(tmp_path: Path) -> list[str]:
    """Files of a rectified pair."""
    files = [str(tmp_path / name) for name in ("left.png", "right.png")]
    for file, picture in zip(files, shifted_pair(96, 160, 12), strict=True):
        cv2.imwrite(file, picture[..., ::-1])
    return files


def test_every_verb_takes_json_and_says_what_it_does_by_default(parsers):
    for parser in parsers:
        assert any("--json" in action.option_strings for action in parser._actions), parser.prog
        for action in parser._actions:
            if action.option_strings and action.nargs != 0 and not action.required:
                shown = parser._get_formatter()._expand_help(action)
                groups = [group for group in parser._mutually_exclusive_groups if action in group._group_actions]
                grouped = any(group.required for group in groups)
                assert grouped or "default" in shown, f"{parser.prog} {action.option_strings[0]}: {shown}"


def test_every_verb_ends_its_help_with_an_example_that_it_takes(parsers):
    assert {parser.prog.removeprefix("endosdk ") for parser in parsers} == set(EXAMPLES)
    for example in EXAMPLES.values():
        build_parser(VERBS).parse_args(example.split()[1:])


@pytest.mark.parametrize("words", [[], ["predict"], ["calibrate"], ["calibrate", "board"], ["simulate"]])
def test_called_bare_it_shows_its_help(words, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(words)
    assert stopped.value.code == 2
    shown = capsys.readouterr().err
    assert shown.startswith("usage: endosdk") and "--help" in shown
    assert "error:" not in shown


def test_a_misspelt_option_is_refused_with_the_usage_of_its_own_command(parsers, capsys):
    for parser in parsers:
        verb = parser.prog.removeprefix("endosdk ")
        with pytest.raises(SystemExit) as stopped:
            main([*EXAMPLES[verb].split()[1:], "--misspelt"])
        assert stopped.value.code == 2
        shown = capsys.readouterr().err
        assert shown.startswith(f"usage: {parser.prog} ") and "unrecognized arguments: --misspelt" in shown


def test_it_runs_as_a_module():
    done = subprocess.run([*RUN, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("endosdk ")


def test_a_result_that_cannot_be_used_is_no_success(tmp_path, capsys):
    dark = str(tmp_path / "dark.png")
    cv2.imwrite(dark, np.zeros((96, 160, 3), np.uint8))
    words = ["predict", dark, dark, "--model", str(TINY_MODEL), "--frames", "0", "--out", str(tmp_path / "out")]
    assert main([*words, "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["status"] == "INVALID" and said["usable"] is False


def test_predict_says_the_same_in_json(pair, tmp_path, capsys):
    StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96)).save(tmp_path / "rig.yaml")
    words = ["predict", *pair, "--model", str(TINY_MODEL), "--calibration", str(tmp_path / "rig.yaml")]
    assert main([*words, "--frames", "1", "--out", str(tmp_path / "out"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["usable"] is True and said["status"] == "OK" and said["provider"] == "CPUExecutionProvider"
    assert said["disparity_px"][1] == pytest.approx(12, abs=0.1)
    assert said["depth_mm"][1] == pytest.approx(1000 / 12, rel=0.02)
    assert said["fps"] > 0 and Path(said["files"]["depth_preview.png"]).is_file()


def test_an_error_is_json_too(pair, capsys):
    assert main(["predict", pair[0], "missing.png", "--model", str(TINY_MODEL), "--json"]) == 2
    printed = capsys.readouterr()
    error = json.loads(printed.out)["error"]
    assert error["code"] == "INVALID_ARGUMENT" and error["argument"] == "frame"
    assert "missing.png" in printed.err


def test_doctor_and_calibrate_speak_json(tmp_path, capsys):
    assert main(["doctor", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["problems"] == [] and "fast" in said["models"]
    rig = tmp_path / "rig.json"
    StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96)).save(rig)
    assert main(["calibrate", "convert", str(rig), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["baseline_mm"] == 5.0 and said["rectified"]["already"] is True


def test_a_pipe_gets_lines_and_nothing_that_moves(pair, tmp_path):
    words = ["predict", *pair, "--model", str(TINY_MODEL), "--frames", "3", "--out", str(tmp_path / "out")]
    done = subprocess.run([*RUN, *words], capture_output=True, check=True)
    assert b"FPS" in done.stdout
    for stream in (done.stdout, done.stderr):
        assert b"\r" not in stream and b"\x1b" not in stream
    assert done.stderr == b""


def test_a_terminal_gets_a_progress_bar(pair, tmp_path):
    words = ["predict", *pair, "--model", str(TINY_MODEL), "--frames", "3", "--out", str(tmp_path / "out")]
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
    with subprocess.Popen([*RUN, *words], stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        drawn = b""
        try:
            while piece := os.read(ours, 4096):
                drawn += piece
        except OSError:  # Linux's way to say that the other end is closed
            pass
        assert process.stdout is not None and b"timing" not in process.stdout.read()
    os.close(ours)
    assert process.returncode == 0
    assert b"timing" in drawn and b"/3" in drawn


WITHOUT_TORCH = """
import sys
class NoTorch:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "torch":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, NoTorch())
from endosdk.commands.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    ("verb", "words"), [("train", ["--data", "x", "--out", "y"]), ("export", ["run", "--out", "x.onnx"])]
)
def test_without_torch_a_line_says_how_to_get_it(verb, words):
    """As where the extra is not installed: the module cannot be imported."""
    command = [sys.executable, "-c", WITHOUT_TORCH, verb]
    done = subprocess.run([*command, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(f"endosdk {verb}: torch: must be installed (python -m pip install 'torch>=")
    assert done.stderr.count("\n") == 1
    subprocess.run([*command, "--help"], capture_output=True, check=True)


def test_the_commands_that_install_extras_name_packages_that_exist():
    """`pip install endosdk[train]` would not: the package may have come from a folder or a file."""
    assert extra_of("torch") == "train" and extra_of("moderngl") == "simulate" and extra_of("no_such_thing") is None
    command = install_command("train")
    assert "torch>=" in command and "onnx>=" in command and "endosdk" not in command
    words = [sys.executable, *shlex.split(command)[1:], "--dry-run", "--no-index"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr  # all of it is installed here, so pip has nothing to do
    assert dependency_missing(ImportError("no", name="pandas")) is None


def test_bash_completes_verbs_and_options(tmp_path):
    if shutil.which("bash") is None:
        pytest.skip("no bash: install it (Debian: apt-get install bash)")
    script = subprocess.run([*RUN, "--print-completion", "bash"], capture_output=True, text=True, check=True).stdout
    (tmp_path / "complete").write_text(script)
    asked = """
source {file}
ask() {{ COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); $function "$1" "${{@: -1}}" "${{@: -2:1}}"; }}
function=$(complete -p endosdk | sed 's/.*-F \\([^ ]*\\).*/\\1/')
ask endosdk pre; echo "${{COMPREPLY[@]}}"
ask endosdk predict --cal; echo "${{COMPREPLY[@]}}"
"""
    done = subprocess.run(
        ["bash", "-c", asked.format(file=tmp_path / "complete")], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["predict", "--calibration"]


def test_completion_knows_its_shells(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["--print-completion", "cmd"])
    assert stopped.value.code == 2 and "bash, zsh" in capsys.readouterr().err


def test_doctor_rectifies_a_raw_pair_before_it_judges(capsys):
    demo = ROOT / "examples" / "data" / "demo"
    pair = ["--pair", str(demo / "left.png"), str(demo / "right.png")]
    assert main(["doctor", *pair]) == 0
    printed = capsys.readouterr().out
    assert "NOT_RECTIFIED: the rows" in printed and "use this pair with care" in printed and "all well" not in printed
    assert main(["doctor", *pair, "--calibration", str(ROOT / "examples" / "data" / "rig.json")]) == 0
    printed = capsys.readouterr().out
    assert "vertical disparity 0." in printed and "all well" in printed


def test_doctor_sees_packages_that_overwrite_each_other(capsys, monkeypatch, tmp_path):
    """A second OpenCV, of which pip knows no more than its metadata."""
    folder = tmp_path / "opencv_python-4.10.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: opencv-python\nVersion: 4.10.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["doctor", "--pair", "no.png", "no.png"]) == 1  # the report comes all the same
    printed = capsys.readouterr().out
    assert "PROBLEM      opencv-python and opencv-python-headless overwrite each other's files" in printed
    assert "all well" not in printed


def test_a_calibration_that_does_not_fit_is_called_that(tmp_path, capsys):
    left, right = shifted_pair(240, 320, 12)
    files = [str(tmp_path / name) for name in ("left.png", "right.png")]
    for file, picture in zip(files, (left, np.roll(right, 9, axis=0)), strict=True):
        cv2.imwrite(file, picture[..., ::-1])
    StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(320, 240)).save(tmp_path / "rig.json")
    words = [*files, "--model", str(TINY_MODEL), "--frames", "0", "--out", str(tmp_path / "out")]
    main(["predict", *words, "--calibration", str(tmp_path / "rig.json")])
    printed = capsys.readouterr().out
    assert "NOT_RECTIFIED" in printed and "RIG_MOVED: the cameras have moved since they were calibrated" in printed
