"""The command that soaks: it goes on where it was, and its record says what was seen."""

import json
import shlex
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.speed import soak
from endosdk import DepthEstimator
from tests.conftest import TINY_MODEL, shifted_pair


@pytest.fixture(autouse=True)
def small_pairs(monkeypatch):
    pairs = [SimpleNamespace(left=left, right=right) for left, right in (shifted_pair(64, 128, n) for n in (5, 7))]
    monkeypatch.setattr(soak, "sample_pairs", lambda: pairs)
    monkeypatch.setattr(soak, "WARM_UP", 1)
    monkeypatch.setattr(soak, "CHECKPOINT", 2)


def run(monkeypatch, file, *options: str) -> None:
    given = ["--model", str(TINY_MODEL), "--threads", "1", "--frames", "8", "--json", str(file)]
    if "--beside" not in options:
        given += ["--load", "0"]
    monkeypatch.setattr(sys, "argv", ["soak", *given, *options])
    soak.main()


def interrupted(monkeypatch, file, *options: str) -> None:
    """Run until one frame after the second checkpoint."""
    with monkeypatch.context() as cut, pytest.raises(KeyboardInterrupt):
        calls = iter(range(100))
        answer = DepthEstimator.predict

        def predict(self, *pair, **more):
            if next(calls) == 2 + 1 + 5:
                raise KeyboardInterrupt
            return answer(self, *pair, **more)

        cut.setattr(DepthEstimator, "predict", predict)
        run(monkeypatch, file, *options)


def test_an_interrupted_run_goes_on_and_is_recorded(monkeypatch, tmp_path):
    file = tmp_path / "soak.json"
    interrupted(monkeypatch, file, "--deadline-ms", "0.001")
    with np.load(file.with_suffix(".npz")) as kept:
        assert len(kept["times"]) == 4 and not file.exists()
    run(monkeypatch, file, "--deadline-ms", "0.001")
    record = json.loads(file.read_text())
    assert (record["frames"], record["runs"], record["marked_in_time"]) == (8, 2, 0)
    assert record["beside"] == 2 * ["0 busy processes"]
    assert (record["late"], record["late_and_unmarked"]) == (8, 0)
    assert list(tmp_path.iterdir()) == [file]


def test_a_run_of_another_command_does_not_go_on(monkeypatch, tmp_path):
    file = tmp_path / "soak.json"
    interrupted(monkeypatch, file, "--deadline-ms", "60000")
    before = file.with_suffix(".npz").read_bytes()
    said = "command must be .* --deadline-ms 60000 .*, as in the checkpoint; got .* --deadline-ms 0.001 .*Remove"
    with pytest.raises(SystemExit, match=said):
        run(monkeypatch, file, "--deadline-ms", "0.001")
    monkeypatch.setattr(soak, "commit", lambda: "another")
    with pytest.raises(SystemExit, match=r"commit must be .*; got another"):
        run(monkeypatch, file, "--deadline-ms", "60000")
    assert file.with_suffix(".npz").read_bytes() == before and not file.exists()


@pytest.mark.parametrize("name", ["command", "model_sha256", "commit", "onnxruntime"])
def test_a_checkpoint_is_of_one_command_model_commit_and_runtime(tmp_path, name):
    made_by = dict.fromkeys(("command", "model_sha256", "commit", "onnxruntime"), "one")
    soak.Tally(made_by, [1.0], [False], [0.0], ["nothing"]).save(tmp_path / "soak.npz")
    assert soak.Tally.load(tmp_path / "soak.npz", made_by).times_ms == [1.0]
    for other in ({**made_by, name: "other"}, {key: made_by[key] for key in made_by if key != name}):
        with pytest.raises(SystemExit, match=f"^{name} must be one, as in the checkpoint; got (other|None)"):
            soak.Tally.load(tmp_path / "soak.npz", other)


def test_late_frames_that_are_not_marked_are_counted_by_the_callers_clock(monkeypatch, tmp_path):
    answer = DepthEstimator.predict

    def predict(self, *pair, **more):
        time.sleep(2e-3 * soak.SLACK_MS)
        return replace(answer(self, *pair, **more), late=False)

    monkeypatch.setattr(DepthEstimator, "predict", predict)
    run(monkeypatch, tmp_path / "soak.json", "--deadline-ms", "0.001")
    record = json.loads((tmp_path / "soak.json").read_text())
    assert (record["late"], record["late_and_unmarked"], record["marked_in_time"]) == (0, 8, 0)


def test_another_answer_ends_the_run(monkeypatch, tmp_path):
    digests = iter([b"first"] * len(soak.sample_pairs()) + [b"first", b"other"])
    monkeypatch.setattr(soak, "digest", lambda result: next(digests))
    with pytest.raises(SystemExit, match="another answer"):
        run(monkeypatch, tmp_path / "soak.json")


def test_a_program_beside_runs_as_long_as_the_soak_and_no_longer(monkeypatch, tmp_path):
    file, mark = tmp_path / "soak.json", tmp_path / "mark"
    program = f"import time, pathlib; pathlib.Path({str(mark)!r}).touch(); time.sleep(600)"
    command = shlex.join([sys.executable, "-c", program])
    with soak.busy(0, command) as burden:
        while not mark.exists():
            assert burden.there()
            time.sleep(0.01)
    assert not burden.there(), "the program must have been ended"
    run(monkeypatch, file, "--beside", command)
    record = json.loads(file.read_text())
    assert shlex.quote(command) in record["command"] and record["beside"] == [command]


def test_a_program_beside_that_ends_early_ends_the_run(monkeypatch, tmp_path):
    answer = DepthEstimator.predict

    def predict(self, *pair, **more):
        time.sleep(0.2)
        return answer(self, *pair, **more)

    monkeypatch.setattr(DepthEstimator, "predict", predict)
    with pytest.raises(SystemExit, match="the program beside has ended"):
        run(monkeypatch, tmp_path / "soak.json", "--beside", "true")
