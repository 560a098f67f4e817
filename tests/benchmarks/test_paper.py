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
from benchmarks.paper import figures, one_kind, tables
from benchmarks.paper.__main__ import main
from benchmarks.paper.experiments import (
    BUDGETS,
    EXPERIMENTS,
    FRAME,
    GROUPS,
    LABELS,
    OUR_PROTOCOL,
    unique_runs,
)
from benchmarks.paper.joined_set import with_test_pairs
from benchmarks.paper.runs import config_gmacs
from benchmarks.paper.speed import speeds
from benchmarks.paper.tables import Scores, learned_from
from benchmarks.tables.pages import PLACE
from endosdk.datasets.layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.jobs.machine import machine_record
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.parity import check_parity
from tests.conftest import ROOT
from tests.training.warped_scenes import warped_pair
from tests.training.warped_set import write_warped_set

PAGE = ROOT / "docs" / "paper" / "report.md"
# Each plane of 8 px has layers of its own in a file, and 24 px hold all truth of the tiny set.
TOY = ["--batch=1", "--train-pairs=4", "--crop", "48", "96", "--max-disparity=24", "--device=cpu", "--budget=gpu"]
SHORT = [*TOY, "--epochs=2"]


@pytest.fixture(scope="module")
def tiny_set(tmp_path_factory):
    """Four training and two test pairs, wide enough for StereoSGBM."""
    threads = torch.get_num_threads()
    torch.set_num_threads(2)
    root = tmp_path_factory.mktemp("set") / "tiny"
    write_warped_set(root, 4, 2, (64, 128), (3.0, 20.0))
    yield root
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def done(tiny_set, tmp_path_factory):
    """The folder after every sub-command; two of the runs of the paper are trained for two steps."""
    base = tmp_path_factory.mktemp("paper")
    places = [f"--{name}={base / name}" for name in ("runs", "results", "docs")]
    given = [f"--data={tiny_set}", *places]
    short = [*SHORT, "--precision=fp32"]
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
    # The page as it is, whose records are others now.
    shutil.copy(PAGE, base / "docs")
    assert main(["report", *places]) == 0
    return base


def test_table_has_the_promised_form_and_names_what_is_missing(done, tiny_set):
    table = json.loads((done / "results/paper/table1.json").read_text())
    assert table["dataset"] == "tiny" and table["pairs"] == 2
    pixels = sum(int(np.isfinite(sample.disparity).sum()) for sample in open_dataset(tiny_set, "test"))
    assert all(row["pixels"] == pixels and row["pixels_noc"] is None for row in table["methods"].values())
    # Table 1 and the ablations; the other table has one of the pairs.
    assert (done / "docs/report.md").read_text().count(f" | 2 | {pixels:,} |") == 2
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
    assert (early["protocol"], early["precision"], early["seed"]) == ("ours", "fp32", 0)
    assert early["hours"] >= 0 and early["train_epe"] > 0 and early["train_pairs_scored"] == 2


def test_rows_of_fewer_pairs_do_not_join_a_table(done, tiny_set):
    given = [f"--data={tiny_set}", f"--runs={done / 'runs'}", f"--results={done / 'results'}"]
    files = {name: (done / "results" / name).read_text() for name in ("paper/table1.json", "paper/ablations.json")}
    for name, file in (("bm", "table1.json"), ("base", "ablations.json")):
        with pytest.raises(InvalidArgument, match=f"must be 2, as in {file}; got 1"):
            main(["evaluate", *given, *SHORT, "--only", name, "--pairs=1"])
    assert files == {name: (done / "results" / name).read_text() for name in files}


def test_rows_that_stay_keep_the_machine_on_which_they_were_timed(tmp_path, tiny_set, monkeypatch):
    reader, file = open_dataset(tiny_set, "test"), tmp_path / "table.json"
    scores = Scores(tmp_path / "scores.json", reader, None)
    known = {"cpu": "Old", "commit": "0", "date": "then"}
    old = {"machine": known, "sha256": reader.sha256, "methods": {"bm": {"ms": 1.0}, "sgbm": {"ms": 2.0}}}
    file.write_text(json.dumps(old))
    method = classical_method("bm", {}, filled=True)
    for _ in range(2):  # the second time the table is of this machine, and the row is kept beside the runs
        tables.write_table(file, scores, {"bm": scores.get("bm", "state", lambda: scores.score(method))})
        rows = json.loads(file.read_text())["methods"]
        assert rows["sgbm"]["timed_on"] == {**known, "instructions": None}
        assert rows["bm"]["timed_on"] == rows["bm"]["scored_on"]
        assert rows["bm"]["timed_on"]["instructions"] == machine_record()["instructions"]
        monkeypatch.setattr(tables, "machine_record", lambda: {"cpu": "New"})


def test_a_new_timing_says_nothing_of_what_it_did_not_time(tmp_path, tiny_set, monkeypatch):
    reader, file = open_dataset(tiny_set, "test"), tmp_path / "table.json"
    here = {"cpu": "Old", "instructions": None, "commit": "0", "date": "then"}
    rows = {name: {"ms": 1.0, "epe": 2.0, "scored_on": here, "timed_on": here} for name in ("bm", "sgbm")}
    rows["bm"]["settings"] = {}
    said = {"command": "python -m benchmarks.paper evaluate", "model_sha256": {}, "machine": here}
    old = {**said, "sha256": reader.sha256, "methods": rows}
    file.write_text(json.dumps(old))
    new = {"cpu": "New", "instructions": ["avx2"], "commit": "1", "date": "now"}
    monkeypatch.setattr(tables, "machine_record", lambda: new)
    tables.retime_table(file, reader, tmp_path, ["bm"])
    found = json.loads(file.read_text())
    assert found["methods"]["bm"]["timed_on"] == new and found["methods"]["bm"]["scored_on"] == here
    assert found["methods"]["bm"]["ms"] != 1.0 and found["methods"]["sgbm"] == rows["sgbm"]
    assert {key: found[key] for key in old if key != "methods"} == {key: old[key] for key in old if key != "methods"}


def test_ablations_stand_in_their_own_table(done):
    record = json.loads((done / "results/paper/ablations.json").read_text())
    assert record["pairs"] == 2 and set(record["groups"]) == set(GROUPS) - {"table1"}
    assert record["groups"]["loss"]["L2"]["pairs"] == 2 and record["groups"]["loss"]["lambda 0"] is None
    row = record["groups"]["range"]["192 px"]
    assert row["protocol"] == "paper" and row["settings"]["augment"] is False
    assert row["epe_in_range"] == row["epe"]  # the whole truth lies within the range


def test_curves_have_loss_and_test_error_after_each_epoch(done):
    row = json.loads((done / "results/paper/ablations.json").read_text())["groups"]["loss"]["L2"]
    curve = row["curve"]
    assert curve["epochs"] == [0.5, 1.0]  # two of four steps of a run of two epochs
    assert len(curve["loss"]) == len(curve["test_epe"]) == 2 and all(error > 0 for error in curve["test_epe"])
    # The last point is the trained network, whose file is scored: the same pairs, the same error.
    assert curve["test_epe"][-1] == pytest.approx(row["epe"], abs=2e-3)
    assert row["last_loss"] == curve["loss"][-1] and curve["loss_steps"] == [1, 1]
    assert row["train_epe"] > 0 and row["epe_common"] > 0
    assert all((done / f"docs/loss_{name}.png").exists() for name in ("loss", "epe", "epe_in_range"))


def test_search_keeps_what_it_tried_best_first_and_on_which_pairs(done, tiny_set):
    record = json.loads((done / "results/paper/sgbm_search.json").read_text())
    for name, found in record["forms"].items():
        errors = [entry["epe"] for entry in found["tried"]]
        assert len(errors) > 20 and errors == sorted(errors)
        assert found["best"] == found["tried"][0]["settings"]
        assert found["best"]["eight_paths"] == (name == "sgbm-hh")
        seen = [entry["settings"] for entry in found["tried"]]
        assert all(len({settings[key] for settings in seen}) > 2 for key in ("small_step", "large_step", "pre_filter"))
    data = open_dataset(tiny_set, "train")
    assert record["data"] == {"name": "tiny", "sha256": data.sha256, "split": "train"}
    assert record["pairs"] == [data[0].id]
    methods = json.loads((done / "results/paper/table1.json").read_text())["methods"]
    assert all(methods[name]["settings"] == record["forms"][name]["best"] for name in ("sgbm", "sgbm-hh"))


def test_new_records_change_nothing_but_the_tables(done):
    before, after = (PLACE.sub("", page.read_text()) for page in (PAGE, done / "docs/report.md"))
    assert before == after
    assert PAGE.read_text() != (done / "docs/report.md").read_text()


def test_a_folder_without_the_page_is_refused(tmp_path):
    with pytest.raises(InvalidArgument, match=r"docs: must be a folder with the page report\.md"):
        main(["report", f"--docs={tmp_path}"])


def test_page_marks_short_runs_and_says_what_is_missing(done):
    text = (done / "docs/report.md").read_text()
    given = r"\*\*stopped early\*\*: 2 of 4 crops of 96 x 48 \| 4 of tiny \(\w{8}\) \| \d+ \| 0\.0\d \| fp32 \| 0 \|"
    assert re.search(rf"\| {re.escape(LABELS['wang2020'])} \| \d.*{given}", text)
    assert re.search(r"\| Table 1 \| .*; PSMNet; PatchMatch stereo \|", text)  # named once, and nowhere with a number
    assert "\n| PSMNet |" not in text
    assert "| StereoBM | tiny, first 1 | " in text
    early = f"{LABELS['wang2020']} stopped at 2 of 4 samples"
    assert re.search(rf"\| StereoSGBM \| error, px \| \*\*undecided\*\* \| .* \| {re.escape(early)} \|", text)
    assert "lambda 0.5 stopped at 2 of 4 samples; L2 stopped at 2 of 4 samples" in text
    assert re.search(r"\| Number of training pairs .* 800 pairs and the test pairs \|", text)
    claims = sum(len(group.claims) for group in GROUPS.values())
    assert text.count("| **not run** |") == claims - 1 + 3  # three orders of Fig. 6


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
    assert LABELS["wang2020"] in titles  # a network has no holes


def test_the_report_shows_every_figure(done):
    page = (done / "docs/report.md").read_text()
    shown = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page)
    assert sorted(shown) == sorted(file.name for file in (done / "docs").glob("*.png"))
    assert len(shown) == 5


def test_finished_runs_and_scores_are_not_done_again(done, tiny_set, capsys):
    given = [f"--data={tiny_set}", f"--runs={done / 'runs'}", f"--results={done / 'results'}"]
    short = [*SHORT, "--steps=2"]
    before = (done / "runs/gpu/wang2020/last.safetensors").stat().st_mtime_ns
    assert main(["train", *given, *short, "--only", "wang2020"]) == 0
    assert "wang2020: done" in capsys.readouterr().err
    assert (done / "runs/gpu/wang2020/last.safetensors").stat().st_mtime_ns == before
    assert main(["evaluate", *given, *short, "--only", "wang2020"]) == 0
    assert "scoring" not in capsys.readouterr().err
    table = json.loads((done / "results/paper/table1.json").read_text())
    assert "sgbm" in table["methods"]  # rows that were not asked for stay


def test_published_network_is_scored_by_its_file_which_computes_what_torch_does(tiny_set, tmp_path):
    given = [f"--data={tiny_set}", f"--runs={tmp_path}", f"--results={tmp_path}", "--only", "anynet-published"]
    short = [*TOY, "--max-disparity=48", "--precision=fp32", "--epochs=1"]
    assert main(["train", *given, *short]) == 0
    assert main(["evaluate", *given, *short]) == 0
    row = json.loads((tmp_path / "paper" / "table1.json").read_text())["methods"]["anynet-published"]
    assert row["complete"] and row["params"] == 43_269
    assert row["epe"] > 0 and row["coverage"] == 1
    assert len(row["stages"]) == 4 and row["stages"][-1] == pytest.approx(row["epe"], rel=2e-3)
    assert row["samples_seen"] == 4 and row["curve"]["epochs"] == [0.5, 1.0]  # and before the last stage joins
    (file,) = (tmp_path / "gpu/anynet-published").glob("*.onnx")
    pairs = [warped_pair(1, size, (3.0, 20.0))[:2] for size in ((96, 160), (75, 133))]
    assert len(check_parity(checkpoint.load(tmp_path / "gpu/anynet-published").build(), file, pairs)["sizes"]) == 2


def test_run_that_was_begun_anew_is_scored_anew(done, tiny_set, tmp_path):
    shutil.copytree(done / "results", tmp_path / "results")
    shutil.copytree(done / "runs", tmp_path / "runs", ignore=shutil.ignore_patterns("*.safetensors", "*.onnx"))
    places = [f"--data={tiny_set}", f"--runs={tmp_path / 'runs'}", f"--results={tmp_path / 'results'}"]
    given = [*places, "--only", "wang2020", *SHORT, "--precision=fp32", "--steps=2", "--crop", "48", "88"]
    assert main(["train", *given]) == 0
    assert main(["evaluate", *given]) == 0
    before, after = (
        json.loads((folder / "results" / "paper" / "table1.json").read_text())["methods"]["wang2020"]
        for folder in (done, tmp_path)
    )
    assert before["samples_seen"] == after["samples_seen"] and before["epe"] != after["epe"]


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
        "--device=cpu",
    ]
    assert main(["train", *given]) == 0
    assert "needs 900 pairs, there are 6" in capsys.readouterr().err
    assert not (tmp_path / "gpu/pairs-900").exists()


def test_volume_with_the_test_pairs_learns_from_them(tiny_set, tmp_path, capsys):
    given = [f"--data={tiny_set}", f"--runs={tmp_path}", "--crop", "48", "96", "--only", "pairs-900"]
    short = ["--train-pairs=5", "--epochs=1", "--budget=gpu", "--device=cpu", "--precision=fp32"]
    assert main(["train", *given, *short]) == 0
    joined = open_dataset(tmp_path / "joined-5", "train")
    train, test = (open_dataset(tiny_set, split) for split in ("train", "test"))
    assert joined.ids == (*train.ids[:3], *test.ids)
    assert np.array_equal(joined[4].left, test[1].left)
    saved = checkpoint.load(tmp_path / "gpu/pairs-900")
    assert saved.step == 5 and saved.state["dataset"]["name"] == "tiny with its test pairs"
    assert "learns from the test pairs" in capsys.readouterr().err
    with pytest.raises(InvalidArgument, match=r"train_pairs: must be 3 to 6.*got 7"):
        with_test_pairs(tiny_set, 7, tmp_path / "other")


def test_run_of_other_settings_is_refused_by_name(done, tiny_set):
    given = [f"--data={tiny_set}", f"--runs={done / 'runs'}", "--budget=gpu", "--device=cpu", "--only", "base"]
    with pytest.raises(InvalidArgument, match=r"the run base must have batch 2; .*; got 1"):
        main(["train", *given, *TOY, "--batch=2", "--epochs=2", "--steps=4"])


def test_rows_of_another_kind_are_refused_by_name(done):
    record = json.loads((done / "results/paper/ablations.json").read_text())
    base, other = record["groups"]["loss"]["lambda 0.5"], record["groups"]["loss"]["L2"]
    one_kind.check_one_kind("ablations.json", {"base": base, "loss-l2": other})
    cases = {
        "loss-l2 must have the precision of base in ablations.json, fp32; got bf16": {"precision": "bf16"},
        "loss-l2 must have the protocol paper in ablations.json; got ours": {"protocol": "ours"},
        "loss-l2 must have the budget of base in ablations.json, gpu; got cpu": {"budget": "cpu"},
        "loss-l2 must have the training set of base": {"train_data": {**other["train_data"], "sha256": "0"}},
        "loss-l2 must have the crop of base": {"settings": {**other["settings"], "crop": [720, 960]}},
    }
    for said, change in cases.items():
        with pytest.raises(InvalidArgument, match=re.escape(said)):
            one_kind.check_one_kind("ablations.json", {"base": base, "loss-l2": {**other, **change}})
    # What the experiment is about may differ, and what an older record does not say is not compared.
    one_kind.check_one_kind("ablations.json", {"base": base, "loss-l2": {**other, "precision": None}})


def test_rows_of_another_set_do_not_join_a_table(done, tmp_path):
    write_warped_set(tmp_path / "other", 1, 2, (64, 128), (3.0, 20.0))
    given = [f"--data={tmp_path / 'other'}", f"--runs={done / 'runs'}", f"--results={done / 'results'}"]
    before = (done / "results/paper/table1.json").read_text()
    with pytest.raises(InvalidArgument, match=r"test-data: must be the set of table1.json, tiny .*got other"):
        main(["evaluate", *given, "--budget=gpu", "--only", "bm"])
    assert (done / "results/paper/table1.json").read_text() == before


# The time may be over while something opens a file, which then nobody closes.
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_one_command_does_it_all_and_goes_on_where_it_stopped(tiny_set, tmp_path, capsys):
    places = [f"--{name}={tmp_path / name}" for name in ("runs", "results", "docs")]
    short = [*TOY, "--precision=fp32"]
    chosen = ["--only", "paper-72", "bm", "--epochs=2", "--pairs=1"]
    (tmp_path / "results/paper").mkdir(parents=True)
    (tmp_path / "results/paper/sgbm_search.json").write_text('{"forms": {}}')
    (tmp_path / "docs").mkdir()
    shutil.copy(PAGE, tmp_path / "docs")
    for minutes in ("1e-9", "1e-4"):  # over before a run begins, and perhaps within one
        assert main(["train", f"--data={tiny_set}", *places, *short, *chosen, f"--minutes={minutes}"]) == 0
        assert "minutes are over" in capsys.readouterr().err
    assert main(["all", f"--data={tiny_set}", *places, *short, *chosen, "--minutes=0.0001"]) == 0
    assert "minutes are over" in capsys.readouterr().err
    # Quick machines come to the first step before they are stopped. A run with a checkpoint has a row, no other has.
    begun = (tmp_path / "runs/gpu/paper-72" / checkpoint.LAST).exists()
    assert begun == (f"\n| {LABELS['paper-72']} |" in (tmp_path / "docs/report.md").read_text())
    assert main(["all", f"--data={tiny_set}", *places, *short, *chosen]) == 0
    row = json.loads((tmp_path / "results/paper/table1.json").read_text())["methods"]["paper-72"]
    assert row["complete"] and row["samples_seen"] == 8 and len(row["curve"]["epochs"]) == 2
    assert f"| {LABELS['paper-72']} | tiny | {row['epe']:.4f} |" in (tmp_path / "docs/report.md").read_text()


@pytest.mark.parametrize("budget", BUDGETS)
def test_every_experiment_is_a_valid_configuration(budget):
    for run in EXPERIMENTS:
        config = TrainConfig.from_dict(run.settings(budget, {}))
        dear = run.protocol == "ours" or run.group != "table1"  # Table 1 has the paper's whole frames
        windowed = budget == "cpu" and dear and config.network != "psmnet"
        assert (config.refine_crop is not None) == windowed
        assert run.group in GROUPS
    assert len(unique_runs()) < len(EXPERIMENTS)
    assert {run.name: run.changes for run in unique_runs()} == {run.name: run.changes for run in EXPERIMENTS}


def test_the_papers_protocol_is_whole_frames_for_sixteen_epochs():
    runs = {run.name: run for run in unique_runs()}
    for budget in BUDGETS:
        for name, largest in (("paper-192", 192), ("paper-72", 72)):
            config = TrainConfig.from_dict(runs[name].settings(budget, {}))
            assert (config.crop, config.max_disparity, config.steps * config.batch) == (FRAME, largest, 16 * 800)
            assert not config.augment and config.refine_crop is None and config.coarse_weight == 1
            rates = [config.rate_at(step) for step in (0, 799, 800, 1600, 12799)]
            assert rates[0] == rates[1] == config.rate == 1e-3 and rates[-1] == pytest.approx(config.final_rate)
            assert rates[2] / rates[1] == pytest.approx(rates[3] / rates[2])
    published = TrainConfig.from_dict(runs["anynet-published"].settings("cpu", {}))
    assert published.crop == FRAME and 0.39 < published.refine_from_step / published.steps < 0.41
    assert config_gmacs(published.as_dict()) * published.steps > 98_700  # ten times the first run's 9.87 TMAC
    psmnet = runs["psmnet"].settings("cpu", {})
    assert psmnet["steps"] * psmnet["batch"] == 12_800


def test_runs_of_one_figure_see_alike_and_what_is_compared_has_seeds():
    for budget in BUDGETS:
        for group in GROUPS.keys() - {"table1"}:
            runs = [run for run in EXPERIMENTS if run.group == group]
            assert len({(s["crop"], s["epochs"], s["batch"]) for s in (run.settings(budget, {}) for run in runs)}) == 1
            for claim in GROUPS[group].claims:
                for label in (claim.run, *claim.others):
                    setting = next(run.setting for run in runs if run.label == label)
                    assert len({run.name for run in unique_runs() if run.setting == setting}) >= 2
    assert len({run.setting for run in unique_runs() if "seed" in run.changes}) >= 5
    first = [run.name for run in unique_runs()]
    assert first.index("range-40") < first.index("paper-192-seed1")


def test_work_of_a_step_counts_what_is_computed():
    whole, window, coarse = (
        config_gmacs({**OUR_PROTOCOL, **part})
        for part in ({}, {"refine_crop": (128, 256)}, {"refine_from_step": OUR_PROTOCOL["steps"]})
    )
    refinement = whole - coarse
    assert refinement == pytest.approx(12 * 9 * 256 * 512 * (4 * 32 + 6 * 32 * 32 + 32) / 1e9)
    seen = (128 + 2 * 24) * (256 + 2 * 24)  # the refinement looks 24 px beyond its window
    assert window == pytest.approx(coarse + refinement * seen / (256 * 512))


def test_speed_of_a_network_is_timed_once_and_for_the_crops_of_its_budget(tmp_path, capsys):
    runs, small = [run for run in unique_runs() if run.name == "wang2020"], {"crop": (48, 96)}
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
    grid, further = {"block_size": (3, 5)}, {"small_step": (8, 4), "large_step": (4, 32)}
    best = search_sgbm([sample], grid=grid, searched=further)
    seen = [entry["settings"] for entry in best["tried"]]
    assert {settings["block_size"] for settings in seen} == {3, 5} and {s["small_step"] for s in seen} == {4, 8}
    assert all(settings["small_step"] < settings["large_step"] for settings in seen)


def test_a_run_that_only_fitted_the_confidence_taught_the_weights_nothing():
    fitted, learned = {"name": "few"}, {"name": "many"}
    assert learned_from({"data": fitted, "steps_done": 0, "init": {"data": learned}}) == learned
    assert learned_from({"data": learned, "steps_done": 9, "init": {"data": fitted}}) == learned
    assert learned_from({"data": learned, "steps_done": 0, "init": None}) == learned
