"""The paper's experiments end to end at toy scale, and the rules by which claims are judged."""

import json
import re
import shutil

import numpy as np
import pytest
import torch

from benchmarks.methods.classical import classical_method, search_sgbm
from benchmarks.methods.kept_patchmatch import kept_match
from benchmarks.methods.patchmatch import PatchMatchSettings
from benchmarks.paper import figures, tables
from benchmarks.paper.__main__ import main
from benchmarks.paper.experiments import BUDGETS, EXPERIMENTS, GROUPS, LABELS, PROTOCOL, unique_runs
from benchmarks.paper.runs import config_gmacs
from benchmarks.paper.speed import speeds
from benchmarks.paper.tables import Scores
from endosdk.datasets.layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.jobs.machine import machine_record
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.parity import check_parity
from tests.training.warped_scenes import warped_pair
from tests.training.warped_set import write_warped_set


@pytest.fixture(scope="module")
def tiny_set(tmp_path_factory):
    """Four training and two test pairs, wide enough for StereoSGBM."""
    torch.set_num_threads(2)
    root = tmp_path_factory.mktemp("set") / "tiny"
    write_warped_set(root, 4, 2, (64, 128), (3.0, 20.0))
    return root


@pytest.fixture(scope="module")
def done(tiny_set, tmp_path_factory):
    """The folder after every sub-command; two of the runs of the paper are trained for two steps."""
    base = tmp_path_factory.mktemp("paper")
    places = [f"--{name}={base / name}" for name in ("runs", "results", "docs")]
    given = [f"--data={tiny_set}", *places]
    short = ["--batch=1", "--train-pairs=4", "--crop", "48", "96", "--device=cpu", "--precision=fp32", "--budget=gpu"]
    chosen = ["--only", "wang2020", "base", "loss-l2"]
    assert main(["plan", *given, *short, *chosen]) == 0
    assert main(["search", *given, "--pairs=1"]) == 0
    assert main(["train", *given, *short, *chosen, "--steps=2"]) == 0
    methods = ["--only", "wang2020", "base", "loss-l2", "sgbm", "sgbm-hh", "bm"]
    # Half of a budget of four steps was used.
    assert main(["evaluate", *given, *short, *methods, "--steps=4"]) == 0
    assert main(["evaluate", *given, "--only", "bm", "--pairs=1", "--table=table1_first"]) == 0
    assert main(["time", *given, "--only", "bm"]) == 0
    assert main(["figures", *given]) == 0
    assert main(["report", *places]) == 0
    return base


def test_table_has_the_promised_form_and_names_what_is_missing(done, tiny_set):
    table = json.loads((done / "results/paper/table1.json").read_text())
    assert table["dataset"] == "tiny" and table["pairs"] == 2
    pixels = sum(int(np.isfinite(sample.disparity).sum()) for sample in open_dataset(tiny_set, "test"))
    assert all(row["pixels"] == pixels and row["pixels_noc"] is None for row in table["methods"].values())
    # Four methods, three of them with holes left open too; two runs in five places of the ablations.
    assert (done / "docs/report.md").read_text().count(f" | 2 | {pixels:,} |") == 4 + 3 + 5
    assert set(table["methods"]) == {"wang2020", "sgbm", "sgbm-hh", "bm"}
    assert set(table["not_yet_run"]) == set(LABELS) - set(table["methods"])
    for row in table["methods"].values():
        assert {"epe", "kpe", "epe_noc", "ms", "params", "gmacs", "coverage"} <= set(row)
        assert set(row["kpe"]) == {"1", "2", "3", "5"}
        assert row["epe"] > 0 and row["ms"] > 0 and row["coverage"] == 1
    assert table["methods"]["sgbm"]["unfilled"]["coverage"] < 1
    assert 250_000 < table["methods"]["wang2020"]["params"] < 320_000
    early = table["methods"]["wang2020"]
    assert (early["samples_seen"], early["samples_planned"], early["complete"]) == (2, 4, False)


def test_rows_of_fewer_pairs_do_not_join_a_table(done, tiny_set):
    given = [f"--data={tiny_set}", f"--runs={done / 'runs'}", f"--results={done / 'results'}"]
    files = {name: (done / "results" / name).read_text() for name in ("paper/table1.json", "paper/ablations.json")}
    for name, file in (("bm", "table1.json"), ("base", "ablations.json")):
        with pytest.raises(InvalidArgument, match=f"must be 2, as in {file}; got 1"):
            main(["evaluate", *given, "--budget=gpu", "--only", name, "--pairs=1"])
    assert files == {name: (done / "results" / name).read_text() for name in files}


def test_rows_that_stay_keep_the_machine_on_which_they_were_timed(tmp_path, tiny_set):
    reader, file = open_dataset(tiny_set, "test"), tmp_path / "table.json"
    scores = Scores(tmp_path / "scores.json", reader, None)
    old = {"machine": {"cpu": "Old"}, "sha256": reader.sha256, "methods": {"bm": {"ms": 1.0}, "sgbm": {"ms": 2.0}}}
    file.write_text(json.dumps(old))
    tables.write_table(file, scores, {"bm": {"ms": 3.0}})
    for _ in range(2):  # the second time the table is of this machine
        rows = json.loads(file.read_text())["methods"]
        assert rows["sgbm"]["timed_on"] == {"cpu": "Old", "instructions": None}
        assert rows["bm"]["timed_on"]["instructions"] == machine_record()["instructions"]
        tables.write_table(file, scores, {})


def test_ablations_stand_in_their_own_table(done):
    record = json.loads((done / "results/paper/ablations.json").read_text())
    assert record["pairs"] == 2 and set(record["groups"]) == set(GROUPS) - {"table1"}
    assert record["groups"]["loss"]["L2"]["pairs"] == 2 and record["groups"]["loss"]["lambda 0"] is None


def test_search_keeps_what_it_tried_best_first_and_on_which_pairs(done, tiny_set):
    record = json.loads((done / "results/paper/sgbm_search.json").read_text())
    errors = [entry["epe"] for entry in record["tried"]]
    assert len(errors) > 20 and errors == sorted(errors)
    assert record["best"] == record["tried"][0]["settings"]
    data = open_dataset(tiny_set, "train")
    assert record["data"] == {"name": "tiny", "sha256": data.sha256, "split": "train"}
    assert record["pairs"] == [data[0].id]
    assert json.loads((done / "results/paper/table1.json").read_text())["methods"]["sgbm"]["settings"] == record["best"]


def test_report_marks_short_runs_and_says_what_is_missing(done):
    text = (done / "docs/report.md").read_text()
    note = r"\*\*stopped early: 2 of 4 crops\*\*, \d+ TMAC of training"
    assert re.search(rf"\| wang2020, by its paper's recipe \| \d.*{note} \|", text)
    assert "| PSMNet | not yet run |" in text
    assert "## Table 1 on the first 1 pairs of tiny" in text
    assert "| PSMNet | not yet run | | | |" in text  # no verdict on what is missing, one on what is there
    assert re.search(
        r"\| StereoSGBM \| 2 \| \*\*undecided\*\*: .* stopped early, after 2 of 4 crops \| not yet run \|", text
    )
    assert "| 900 pairs | not yet run |" in text
    assert re.search(r"Ours: \*\*undecided\*\*: lambda 0.5 stopped early, after 2 of 4 crops, L2 stopped early", text)
    assert text.count("Ours: not yet run: ") == 5
    for group in GROUPS.values():
        assert f"## {group.title} ({group.figures})" in text


def test_picture_of_methods_shows_the_answers_of_the_table(done, tiny_set, monkeypatch):
    sample, drawn = open_dataset(tiny_set, "test")[0], []
    settings = json.loads((done / "results/paper/table1.json").read_text())["methods"]["sgbm"]["settings"]
    monkeypatch.setattr(figures, "_save", lambda figure, file: drawn.append(figure) or file)
    places = [f"--{name}={done / name}" for name in ("runs", "results", "docs")]
    assert main(["figures", f"--data={tiny_set}", *places]) == 0
    titles = [axes.get_title() for axes in drawn[-1].axes]
    filled = classical_method("sgbm", settings, filled=True)(sample).disparity
    mean = np.nanmean(np.abs(filled - sample.disparity))
    assert titles[titles.index("StereoSGBM, holes filled") + 1] == f"error, 0 to 3 px; mean {mean:.3f} px"
    assert "wang2020, by its paper's recipe" in titles  # a network has no holes


def test_page_is_self_contained(done):
    page = (done / "docs/report.html").read_text()
    assert page.count('src="data:image/png;base64,') == len(list((done / "docs").glob("*.png"))) == 4
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert page.count("<table>") == page.count("</table>") == 7
    assert "<b>stopped early: 2 of 4 crops</b>" in page


def test_finished_runs_and_scores_are_not_done_again(done, tiny_set, capsys):
    given = [f"--data={tiny_set}", f"--runs={done / 'runs'}", f"--results={done / 'results'}"]
    short = ["--batch=1", "--train-pairs=4", "--crop", "48", "96", "--device=cpu", "--steps=2", "--budget=gpu"]
    before = (done / "runs/gpu/wang2020/last.safetensors").stat().st_mtime_ns
    assert main(["train", *given, *short, "--only", "wang2020"]) == 0
    assert "wang2020: done" in capsys.readouterr().err
    assert (done / "runs/gpu/wang2020/last.safetensors").stat().st_mtime_ns == before
    assert main(["evaluate", *given, *short, "--only", "wang2020"]) == 0
    assert "scoring" not in capsys.readouterr().err
    table = json.loads((done / "results/paper/table1.json").read_text())
    assert "sgbm" in table["methods"]  # rows that were not asked for stay


def test_rival_is_scored_by_its_file_which_computes_what_torch_does(tiny_set, tmp_path):
    given = [f"--data={tiny_set}", f"--runs={tmp_path}", f"--results={tmp_path}", "--only", "anynet"]
    short = ["--batch=1", "--train-pairs=4", "--crop", "48", "96", "--precision=fp32", "--steps=1", "--budget=gpu"]
    assert main(["train", *given, *short]) == 0
    assert main(["evaluate", *given, *short]) == 0
    row = json.loads((tmp_path / "paper" / "table1.json").read_text())["methods"]["anynet"]
    assert row["complete"] and row["params"] == 43_315
    assert row["epe"] > 0 and row["coverage"] == 1
    (file,) = (tmp_path / "gpu/anynet").glob("*.onnx")
    pairs = [warped_pair(1, size, (3.0, 20.0))[:2] for size in ((96, 160), (75, 133))]
    assert len(check_parity(checkpoint.load(tmp_path / "gpu/anynet").build(), file, pairs)["sizes"]) == 2


def test_run_that_was_begun_anew_is_scored_anew(tiny_set, tmp_path):
    given = [f"--data={tiny_set}", f"--runs={tmp_path}", f"--results={tmp_path}", "--only", "wang2020", "--steps=1"]
    rows = []
    for width in ("96", "88"):
        short = ["--batch=1", "--train-pairs=4", "--crop", "48", width, "--precision=fp32", "--budget=gpu"]
        assert main(["train", *given, *short]) == 0
        assert main(["evaluate", *given, *short]) == 0
        rows.append(json.loads((tmp_path / "paper" / "table1.json").read_text())["methods"]["wang2020"])
        shutil.rmtree(tmp_path / "gpu")
    assert rows[0]["samples_seen"] == rows[1]["samples_seen"] and rows[0]["epe"] != rows[1]["epe"]


def test_scores_taken_beside_one_another_are_all_kept(tiny_set, tmp_path):
    reader = open_dataset(tiny_set, "test")
    beside = [Scores(tmp_path / "scores.json", reader, None) for _ in range(2)]
    for name, scores in zip("ab", beside, strict=True):
        scores.get(name, "state", lambda name=name: {"epe": ord(name)})
    again = Scores(tmp_path / "scores.json", reader, None)
    assert [again.get(name, "state", dict) for name in "ab"] == [{"epe": ord(name)} for name in "ab"]
    assert again.get("a", "another state", dict) == {}


def test_run_that_needs_more_pairs_than_there_are_is_left_out(tiny_set, tmp_path, capsys):
    given = [
        f"--data={tiny_set}",
        f"--runs={tmp_path}",
        "--steps=1",
        "--crop",
        "48",
        "96",
        "--only",
        "pairs-900",
        "--budget=gpu",
    ]
    assert main(["train", *given]) == 0
    assert "needs 900 pairs, there are 4" in capsys.readouterr().err
    assert not (tmp_path / "gpu/pairs-900").exists()


@pytest.mark.parametrize("budget", BUDGETS)
def test_every_experiment_is_a_valid_configuration(budget):
    for run in EXPERIMENTS:
        config = TrainConfig.from_dict(run.settings(budget, {}))
        assert (config.refine_crop is None) == (budget == "gpu" or config.network in ("anynet", "psmnet"))
        assert run.group in GROUPS
    assert len(unique_runs()) < len(EXPERIMENTS)
    assert {run.name: run.changes for run in unique_runs()} == {run.name: run.changes for run in EXPERIMENTS}


def test_small_budget_is_the_same_for_all_runs_of_a_table_but_the_one_that_is_too_dear():
    for budget in BUDGETS:
        for table in ((run for run in EXPERIMENTS if (run.group == "table1") == first) for first in (True, False)):
            planned = {(s["steps"], s["batch"], s["crop"]) for s in (run.planned(budget, {}) for run in table)}
            assert len(planned) == 1
    assert EXPERIMENTS[0].planned("cpu", {})["steps"] == PROTOCOL["steps"]
    assert EXPERIMENTS[-1].planned("cpu", {})["steps"] < PROTOCOL["steps"]
    short = [run.name for run in unique_runs() if run.settings("cpu", {})["steps"] < run.planned("cpu", {})["steps"]]
    assert short == ["psmnet"]
    assert next(run for run in EXPERIMENTS if run.name == "psmnet").settings("cpu", {"steps": 2})["steps"] == 2


def test_work_of_a_step_counts_what_is_computed():
    whole, window, coarse = (
        config_gmacs({**PROTOCOL, **part})
        for part in ({}, {"refine_crop": (128, 256)}, {"refine_from_step": PROTOCOL["steps"]})
    )
    refinement = whole - coarse
    assert refinement == pytest.approx(12 * 9 * 256 * 512 * (4 * 32 + 6 * 32 * 32 + 32) / 1e9)
    seen = (128 + 2 * 24) * (256 + 2 * 24)  # the refinement looks 24 px beyond its window
    assert window == pytest.approx(coarse + refinement * seen / (256 * 512))


def test_speed_of_a_network_is_timed_once_and_for_the_crops_of_its_budget(tmp_path, capsys):
    runs, small = unique_runs()[:1], {"crop": (48, 96)}
    first = speeds(runs, tmp_path / "speed.json", "cpu", "gpu", small)
    assert first["wang2020"] > 0
    assert "timing a training step of wang2020" in capsys.readouterr().err
    assert speeds(runs, tmp_path / "speed.json", "cpu", "gpu", small) == first
    assert "timing" not in capsys.readouterr().err
    speeds(runs, tmp_path / "speed.json", "cpu", "gpu", {"crop": (48, 128)})
    assert "timing" in capsys.readouterr().err


def test_answers_of_patchmatch_are_computed_once(tiny_set, tmp_path):
    sample = open_dataset(tiny_set, "test")[0]
    method = kept_match(tmp_path, PatchMatchSettings(max_disparity=24, radius=4, rounds=1))
    first, again = method(sample), method(sample)
    for one, other in zip(first, again, strict=True):
        assert np.array_equal(one.disparity, other.disparity, equal_nan=True)
        assert one.milliseconds == other.milliseconds > 0
    assert np.isfinite(first[0].disparity).all() and 0 < np.isnan(first[1].disparity).mean() < 1


def test_search_and_classical_methods_refuse_what_they_cannot_use(tiny_set):
    with pytest.raises(InvalidArgument, match="samples"):
        search_sgbm([])
    with pytest.raises(InvalidArgument, match="method"):
        classical_method("census", {}, filled=True)
    sample = open_dataset(tiny_set, "test")[0]
    best = search_sgbm([sample], {"block_size": (3, 5), "uniqueness_ratio": (0,)})
    assert len(best["tried"]) == 2 and best["best"]["block_size"] in (3, 5)
