import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk import StereoCalibration, __version__
from endosdk.commands.cli import VERBS, main
from tests.conftest import TINY_MODEL, shifted_pair


def write(path, picture):
    cv2.imwrite(str(path), picture[..., ::-1])
    return str(path)


def predicted_against(truth, folder):
    """Exit status of `predict` for views 12 px apart, against a true disparity; its answer is in the folder."""
    left, right = shifted_pair(96, 160, 12)
    pair = [write(folder / f"{name}.png", view) for name, view in (("l", left), ("r", right))]
    cv2.imwrite(str(folder / "truth.png"), (truth * 256).astype(np.uint16))
    return main(["predict", *pair, "--model", str(TINY_MODEL), "--truth", str(folder / "truth.png"), "--json"])


def test_predict_says_its_error(tmp_path, capsys):
    truth = np.zeros((96, 160))  # 0: not known
    truth[20:60, 70:150] = 12
    truth[60:70, 70:150] = 14
    assert predicted_against(truth, tmp_path) == 0
    error = json.loads(capsys.readouterr().out)["error"]
    assert error["pixels"] == 50 * 80
    assert error["epe_px"] == pytest.approx(0.2 * 2, abs=0.1)
    assert error["kpe_1"] == pytest.approx(0.2, abs=0.01)


def test_a_truth_that_knows_nothing_is_refused(tmp_path, capsys):
    assert predicted_against(np.zeros((96, 160)), tmp_path) == 2
    assert "truth: must hold the disparity of at least one pixel" in capsys.readouterr().err


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb, capsys):
    with pytest.raises(SystemExit) as stopped:
        main([verb, "--help"])
    assert stopped.value.code == 0
    assert "--help" in capsys.readouterr().out


def test_version(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert __version__ in capsys.readouterr().out


def test_predict_leaves_every_map(tmp_path, capsys):
    left, right = shifted_pair(96, 160, 12)
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    rig.save(tmp_path / "rig.json")
    status = main(
        [
            "predict",
            write(tmp_path / "l.png", left),
            write(tmp_path / "r.png", right),
            *("--model", str(TINY_MODEL)),
            *("--calibration", str(tmp_path / "rig.json")),
            *("--out", str(tmp_path / "out")),
        ]
    )
    assert status == 0
    printed = capsys.readouterr().out
    assert "FPS" in printed
    assert "mm (median" in printed
    depth = cv2.imread(str(tmp_path / "out" / "depth.png"), cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.uint16
    assert np.median(depth[depth > 0]) / 10 == pytest.approx(1000 / 12, abs=1)
    disparity = cv2.imread(str(tmp_path / "out" / "disparity.png"), cv2.IMREAD_UNCHANGED)
    assert np.median(disparity[8:-8, 56:-8]) / 256 == pytest.approx(12, abs=0.1)
    overview = cv2.imread(str(tmp_path / "out" / "overview.png"))
    assert overview.shape[0] > 2 * 96
    assert overview.std() > 20


def test_predict_names_the_causes_and_leaves_no_map_of_an_earlier_pair(tmp_path, capsys):
    left, right = shifted_pair(96, 160, 12)
    StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96)).save(tmp_path / "rig.json")
    pair = [write(tmp_path / "l.png", left), write(tmp_path / "r.png", right)]
    options = ["--model", str(TINY_MODEL), "--out", str(tmp_path / "out")]
    # As often as this, the same pair would be a frozen one.
    assert main(["predict", *pair, *options, "--calibration", str(tmp_path / "rig.json"), "--frames", "30"]) == 0
    assert "status OK" in capsys.readouterr().out and (tmp_path / "out" / "points.ply").exists()
    assert main(["predict", pair[0], pair[0], *options]) == 1
    assert "cause      SAME_VIEW_TWICE: one camera is connected to both inputs" in capsys.readouterr().out
    found = {path.name for path in (tmp_path / "out").iterdir()}
    assert found == {"overview.png", "disparity.png", "confidence.png", "reasons.png", "result.json"}
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert (record["left"], record["right"], record["status"]) == ("l.png", "l.png", "INVALID")
    main(["predict", pair[0], pair[0], *options, "--json"])
    said = json.loads(capsys.readouterr().out)
    assert "SAME_VIEW_TWICE" in said["causes"] and said["causes"] == record["causes"]
    assert said["files"]["result.json"] == str(tmp_path / "out" / "result.json")
    assert main(["predict", *pair, *options, "--frames", "-1"]) == 2


def test_unrectified_pair_is_called_out(tmp_path, capsys):
    left, right = shifted_pair(240, 320, 12)
    right = np.roll(right, 9, axis=0)
    pair = [write(tmp_path / "l.png", left), write(tmp_path / "r.png", right)]
    assert main(["predict", *pair, "--model", str(TINY_MODEL), "--frames", "0", "--out", str(tmp_path / "o")]) == 1
    assert "NOT_RECTIFIED: the rows of the two views do not correspond" in capsys.readouterr().out


def test_vertical_disparity_is_in_pixels_of_the_frame(tmp_path, capsys):
    left, right = shifted_pair(480, 640, 12)
    right = np.roll(right, 3, axis=0)
    pair = [write(tmp_path / "l.png", left), write(tmp_path / "r.png", right)]
    options = ["--model", str(TINY_MODEL), "--frames", "0", "--network-size", "160x120", "--out", str(tmp_path / "o")]
    main(["predict", *pair, *options])  # whether the tiny model is sure enough is not asked here
    assert "vertical disparity 3.0" in capsys.readouterr().out


def test_an_interrupt_is_no_traceback(monkeypatch, capsys):
    import endosdk.commands.doctor

    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(endosdk.commands.doctor, "run", interrupted)
    assert main(["doctor"]) == 130
    assert capsys.readouterr().err == "endosdk doctor: interrupted\n"


@pytest.mark.parametrize("words", [["doctor"], ["--print-completion", "bash"]])
def test_a_reader_that_goes_away_is_no_traceback(words):
    program = f"import sys; from endosdk.commands.cli import main; sys.exit(main({words}))"
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as doctor:
        doctor.stdout.close()
        printed = doctor.stderr.read()
        assert doctor.wait(timeout=60) == 141
    assert b"Traceback" not in printed and b"BrokenPipe" not in printed


def test_bad_input_is_one_line_and_status_2(tmp_path, capsys):
    left, _ = shifted_pair(32, 64, 2)
    path = write(tmp_path / "l.png", left)
    assert main(["predict", path, str(tmp_path / "missing.png"), "--model", str(TINY_MODEL)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("endosdk predict: frame: must be a file that exists")
    assert printed.count("\n") == 1


def test_bad_size_is_refused(tmp_path, capsys):
    left, _ = shifted_pair(32, 64, 2)
    path = write(tmp_path / "l.png", left)
    assert main(["predict", path, path, "--model", str(TINY_MODEL), "--network-size", "960"]) == 2
    assert "960x720" in capsys.readouterr().err


def test_limits_take_depth_from_pixels(tmp_path, capsys):
    left, right = shifted_pair(96, 160, 12)  # 83.3 mm away
    StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96)).save(tmp_path / "rig.json")
    rig = ("--calibration", str(tmp_path / "rig.json"))
    words = [write(tmp_path / "l.png", left), write(tmp_path / "r.png", right), "--model", str(TINY_MODEL), *rig]

    def depths(*limits):
        main(["predict", *words, "--out", str(tmp_path / "out"), *limits])
        depth = cv2.imread(str(tmp_path / "out" / "depth.png"), cv2.IMREAD_UNCHANGED) / 10
        return depth[depth > 0]

    without = depths()
    assert np.median(without) == pytest.approx(1000 / 12, abs=1)
    within = depths("--depth-range", "80,85")
    assert 0 < within.size < without.size and within.min() >= 79.9 and within.max() <= 85.1
    assert depths("--depth-range", "90,200").size < 0.2 * without.size
    assert depths("--min-confidence", "1").size < without.size


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        (("--depth-range", "20"), "depth_range_mm: must be NEAREST,FARTHEST in mm, such as 20,200; got '20'"),
        (("--depth-range", "200,20"), "depth_range_mm: must be"),
        (("--depth-range", "20,200"), "CALIBRATION_REQUIRED"),
        (("--min-confidence", "1.5"), "min_confidence: must be"),
    ],
)
@pytest.mark.parametrize("verb", ["predict", "batch"])
def test_limits_that_cannot_be_are_refused(verb, limits, said, tmp_path, capsys):
    pair = []
    for side, view in zip(("left", "right"), shifted_pair(32, 64, 2), strict=True):
        (tmp_path / side).mkdir()
        path = write(tmp_path / side / "1.png", view)
        pair.append(path if verb == "predict" else str(tmp_path / side))
    assert main([verb, *pair, "--out", str(tmp_path / "out"), "--model", str(TINY_MODEL), *limits]) == 2
    assert said in capsys.readouterr().err


def test_doctor_is_content_with_this_installation(capsys):
    assert main(["doctor"]) == 0
    printed = capsys.readouterr().out
    assert "telemetry off" in printed
    assert "CPUExecutionProvider" in printed


@pytest.mark.parametrize(("program", "option"), [("endosdk", "--version"), ("endosdk-bench", "--help")])
def test_installed_entry_points_run(program, option):
    command = [str(Path(sys.executable).parent / program), option]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert {"--version": __version__, "--help": "usage: endosdk bench "}[option] in done.stdout


def test_output_that_cannot_be_written_is_one_line_and_status_2():
    program = "import sys; from endosdk.commands.cli import main; sys.exit(main(['doctor', '--json']))"
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([sys.executable, "-c", program], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "endosdk doctor: output: must be writable; got No space left on device [STORAGE_FAILED]\n"


@pytest.mark.parametrize("refused", [PermissionError(13, "Permission denied", "a.png"), ConnectionError("refused")])
def test_what_the_system_refuses_is_one_line_and_status_2(refused, monkeypatch, capsys):
    import endosdk.commands.doctor

    def fail(_):
        raise refused

    monkeypatch.setattr(endosdk.commands.doctor, "run", fail)
    assert main(["doctor", "--json"]) == 2
    printed = capsys.readouterr()
    said = f"the system refused a file, a folder or a connection: {refused}"
    assert printed.err == f"endosdk doctor: {said} [STORAGE_FAILED]\n"
    assert json.loads(printed.out)["error"] == {
        "code": "STORAGE_FAILED", "argument": "", "rule": said, "value": str(refused)
    }  # fmt: skip


def test_closed_output_is_no_error():
    program = "import sys; from endosdk.commands.cli import main; sys.exit(main(['doctor']))"
    done = subprocess.run(["sh", "-c", '"$0" -c "$1" >&-', sys.executable, program], stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (0, "")
