"""What the tables of the page on the paper say of the records, and that nothing else on the page depends on them."""

import json
from functools import partial
from pathlib import Path

import pytest

from benchmarks.paper.experiments import GROUPS, LABELS, RANGES
from benchmarks.paper.page_tables import FROM_RECORDS, page_tables
from benchmarks.paper.paper_records import given, label_of
from benchmarks.paper.rows import KPE, row
from benchmarks.tables import records
from benchmarks.tables.pages import PLACE
from benchmarks.tables.ranges import facts_of
from endosdk.errors import InvalidArgument
from endosdk.io.whole_files import write_json
from endosdk.runtime.models import read_model

RESULTS = records.RESULTS
SEEN = {"samples_seen": 1600, "samples_planned": 1600, "complete": True, "crop": [120, 960], "refine_crop": None}


@pytest.fixture
def table1():
    return json.loads((RESULTS / "paper" / "table1.json").read_text())


@pytest.fixture
def shipped():
    """The rows of the shipped models."""
    rows = json.loads((RESULTS / "paper" / "table1.json").read_text())["methods"]
    return {name: row for name, row in rows.items() if name.startswith("shipped-")}


def cells(results, name):
    """Return the cells of a table of the page, line by line, heads first."""
    lines = page_tables(results, Path("none"))[f"paper-{name}"]().splitlines()
    return [[cell.strip() for cell in line.split(" | ")] for line in lines if line.startswith("|")]


def test_the_page_has_every_table():
    pages = (records.SOURCES / "docs" / name for name in ("paper/report.md", "history/paper.md"))
    placed = [name for page in pages for _, name, _ in PLACE.findall(page.read_text())]
    assert sorted(placed) == sorted(page_tables(RESULTS, Path("none")))


def test_a_folder_without_records_gives_tables_without_numbers(tmp_path):
    for name in FROM_RECORDS:
        head, _, *rows = cells(tmp_path, name)
        assert rows and all(len(one) == len(head) for one in rows), name
    missing = " ".join(word for line in cells(tmp_path, "not-run") for word in line)
    assert all(label in missing for label in LABELS.values())
    assert all(f"{group.title} ({group.figures})" in missing for key, group in GROUPS.items() if key != "table1")


def test_what_has_been_run_is_not_named_as_missing(tmp_path, table1):
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": {"psmnet": table1["methods"]["psmnet"]}})
    write_json(tmp_path / "paper" / "table1_few.json", {**table1, "methods": {"bm": table1["methods"]["bm"]}})
    (said,) = (line[1] for line in cells(tmp_path, "not-run") if line[0] == "| Table 1")
    assert LABELS["psmnet"] not in said and LABELS["bm"] not in said and LABELS["patchmatch"] in said


def test_missing_seeds_and_runs_that_stopped_early_are_named(tmp_path, table1):
    methods = {"paper-192": {**SEEN, "epe": 1.0}, "paper-192-seed2": {**SEEN, "epe": 1.0}}
    methods["psmnet"] = {**table1["methods"]["psmnet"], "samples_seen": 7, "samples_planned": 9}
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": methods})
    groups = {"pairs": {"800 pairs": {**SEEN, "epe": 1.0}, "100 pairs, seed 1": {**SEEN, "epe": 1.0}}}
    groups["loss"] = {"L2": {**SEEN, "complete": False, "samples_seen": 800}}
    write_json(tmp_path / "paper" / "ablations.json", {"groups": groups})
    said = {line[0][2:]: line[1:] for line in cells(tmp_path, "not-run")}
    missing, early = said["Table 1"]
    assert missing.startswith(f"{LABELS['paper-192']}, seed 1; {LABELS['paper-72']}; ")
    assert early == f"{LABELS['psmnet']}: 7 of 9 samples |"
    assert said["Loss (Fig. 5)"] == [
        "L2, seed 1; lambda 0; lambda 0.5, seeds 1 and 2; lambda 1",
        "L2: 800 of 1600 samples |",
    ]
    missing, early = said["Number of training pairs (Fig. 7, 8)"]
    named = ["100 pairs", "400 pairs", "800 pairs, seeds 1 and 2", "800 pairs and the test pairs"]
    assert (missing.split("; "), early) == (named, "|")


def test_what_the_paper_states_stands_above_what_was_measured():
    stated = cells(RESULTS, "errors")[2:4]
    assert [line[0] for line in stated] == ["| wang2020, as its paper states", "| AnyNet, as that paper states"]
    assert stated[0][2] == "0.4145"
    assert [line[-1] for line in stated] == ["21.8 (45 FPS, GTX 1080) |", "37.0 (27 FPS) |"]


def test_the_range_of_every_method_is_stated(tmp_path, table1, shipped):
    rows = {line[0][2:]: line[3] for line in cells(RESULTS, "runs")[2:]}
    of_runs = {"wang2020": "72", "psmnet": "80", "anynet-published": "192"}
    matchers = {"patchmatch": "72", "sgbm": "80", "sgbm-hh": "80", "bm": "80"}
    for name, found in (of_runs | matchers).items():
        assert rows[LABELS[name]] == found, name
    fast = {**shipped["shipped-fast"], "version": "0"}  # the file that ships says nothing of it
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": {**shipped, "shipped-fast": fast}})
    assert [line[3] for line in cells(tmp_path, "runs")[2:]] == ["72", "not recorded"]


def test_a_row_says_what_it_was_given():
    trained = {**SEEN, "training_tmacs": 26.4, "hours": 0.5, "precision": "bf16", "seed": 1, "budget": "gpu"}
    assert given(trained) == ["1600 crops of 960 x 120", "", "26", "0.50", "bf16", "1", "GPU"]
    changed = {"crop": [720, 960], "samples_planned": 3200, "complete": False, "rate_restarts": [900]}
    assert given({**trained, **changed, "train_data": {"name": "gi", "pairs": 800, "sha256": 64 * "3"}})[:2] == [
        "**stopped early**: 1600 of 3200 whole frames; rate raised after step 900",
        "800 of gi (33333333)",
    ]
    assert given({**SEEN, "training_tmacs": 1.0})[3:] == ["not recorded", "not recorded", "0", "not recorded"]
    windowed = {**SEEN, "training_tmacs": 1.0, "refine_crop": [60, 120]}
    assert given(windowed)[0].endswith("; refinement on 120 x 60 of each")
    assert given({"trained_on": {"name": "all", "pairs": 7, "sha256": "12"}})[:2] == [
        "a recipe of our own",
        "7 of all (12)",
    ]
    assert given({})[0] == "no training"


def test_a_shipped_model_has_its_version_and_a_mark_if_its_file_is_gone():
    ships = {"version": "12", "model_sha256": read_model("fast").sha256}
    assert label_of("shipped-fast", ships) == "fast as shipped, version 12"
    for other in ({"model_sha256": "0"}, {"model_sha256": None}):
        assert label_of("shipped-fast", ships | other).endswith(f"version 12 {records.STALE}")
    assert label_of("sgbm", {}) == LABELS["sgbm"]


def test_every_table_with_a_file_that_does_not_ship_says_so(tmp_path, table1, shipped):
    parts = {"edges": {"epe": 1.0, "pixels": 10}}
    rows = {name: {**values, "parts": parts} for name, values in (table1["methods"] | shipped).items()}
    for name in ("wang2020", "fast"):
        rows[f"shipped-{name}"]["model_sha256"] = read_model(name).sha256
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": rows})
    make = {name: partial(page_tables(tmp_path, Path("none"))[f"paper-{name}"]) for name in ("errors", "runs", "parts")}
    assert all(records.STALE not in one() for one in make.values())
    rows["shipped-fast"]["model_sha256"] = "0" * 64
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": rows})
    for one in make.values():
        text = one()
        assert text.count(records.STALE) == 2 and text.endswith(f"\n{records.STALE_NOTE}\n")


def test_errors_on_training_pairs_and_after_stages_are_shown(tmp_path, table1):
    names = ("anynet-published-seed1", "psmnet", "wang2020")
    rows = table1["methods"] = {name: table1["methods"][name] for name in names}
    rows["wang2020"] |= {"train_epe": 0.4, "train_pairs_scored": 100}
    rows["psmnet"]["stages"] = [3.0, 2.0, 1.5, 1.0]
    write_json(tmp_path / "paper" / "table1.json", table1)
    learned, seed = cells(tmp_path, "learned")[2:]
    assert learned == [f"| {LABELS['wang2020']}", "100", "0.400", f"{rows['wang2020']['epe']:.3f} |"]
    assert seed[0] == f"| {LABELS['anynet-published']}, seed 1"
    stages, seed = cells(tmp_path, "stages")[2:]
    assert stages[1:] == ["3.000", "2.000", "1.500", "1.000 |"]
    assert seed[0] == f"| {LABELS['anynet-published']}, seed 1"


def test_the_methods_of_table_1_are_judged(table1):
    judged = {tuple(line[:3]): line[3:5] for line in cells(RESULTS, "methods")}
    for other in ("psmnet", "sgbm", "sgbm-hh"):
        ours, theirs = (table1["methods"][name] for name in ("wang2020", other))
        verdict, numbers = judged[f"| {LABELS['wang2020']}", LABELS[other], "time, ms"]
        assert numbers == f"{ours['ms']:.1f} against {theirs['ms']:.1f}"
        decided = "**held**" if ours["ms"] < theirs["ms"] else "**did not hold**"
        machines = [(one["timed_on"]["cpu"], one["timed_on"]["instructions"]) for one in (ours, theirs)]
        one_machine = machines[0] == machines[1] and None not in machines[0]
        assert verdict == (decided if one_machine else "**undecided**")


def test_every_setting_that_was_repeated_is_listed_and_the_largest_difference_is_the_bound():
    head, _, *lines = cells(RESULTS, "repeats")
    rows, bounds = ([line for line in lines if ("largest" in line[0]) == which] for which in (False, True))
    assert {line[0] for line in rows} >= {"| 100 pairs", "| 100 pairs, coarse alone", f"| {LABELS['anynet-published']}"}
    assert [line[0].split()[-4] for line in bounds] == ["100", "400", "800"]
    few = ("| 100 pairs", "| 400 pairs")
    for bound, fewer in zip(bounds, ((), few[:1], few), strict=True):
        for at in range(1, len(head)):
            shares = [
                float(line[at].split()[0]) for line in rows if line[at].strip("| ") and not line[0].startswith(fewer)
            ]
            found = bound[at].strip(" |")
            assert found == (f"**{max(shares):.1f} %**, of {len(shares)}" if shares else "")


def test_ablations_on_another_rendering_of_the_same_pictures_count(tmp_path, table1):
    first, second = ({**SEEN, "epe": error, "kpe": {"1": 0.1}, "training_tmacs": 1.0} for error in (1.0, 1.5))
    write_json(tmp_path / "paper" / "table1.json", table1)
    same = {**table1, "sha256": "other", "methods": {"bm": table1["methods"]["bm"]}}
    write_json(tmp_path / "paper" / "table1_again.json", same)
    set_ = {"dataset": "gi", "pairs": 10}
    for name, sha256, label, row_ in (
        ("ablations", table1["sha256"], "72 px", first),
        ("ablations_again", "other", "72 px, seed 1", {**second, "pixels": 7}),
        ("ablations_else", "of other pictures", "56 px", second),
    ):
        rows = {"pixels": 7, **row_}
        write_json(tmp_path / "paper" / f"{name}.json", {**set_, "sha256": sha256, "groups": {"range": {label: rows}}})
    assert [line[0] for line in cells(tmp_path, "ablations")[2:]] == ["| 72 px", "| 72 px, seed 1"]
    assert [line[0] for line in cells(tmp_path, "sets")[-2:]] == ["| gi, for the ablations"] * 2
    assert ["| 72 px", "50.0 %"] in [line[:2] for line in cells(tmp_path, "repeats")]


def test_a_loss_of_single_batches_is_none_of_an_epoch(tmp_path):
    """Runs of before logged one batch of twenty."""
    seen = {**SEEN, "epe": 1.0, "kpe": {"1": 0.1}, "training_tmacs": 1.0, "last_loss": 0.25}
    curves = {"72 px": {"loss": [0.5, 0.25]}, "48 px": {"loss": [0.5, 0.25], "loss_steps": [20.0, 20.0]}}
    rows = {label: {**seen, "curve": curve} for label, curve in curves.items()}
    write_json(tmp_path / "paper" / "ablations.json", {"groups": {"range": rows}})
    assert [line[5] for line in cells(tmp_path, "ablations")[2:]] == ["", "0.25"]


def test_blur_and_noise_are_judged_by_their_own_bounds(tmp_path, table1):
    """Two runs of AnyNet differ by 25 % in noise here, and by 1 % near edges."""

    def run(edges, noise, **more):
        return {**SEEN, "epe": 1.0, "parts": {"edges": {"epe": edges}}, "noise": noise, **more}

    again = {"train_data": {"sha256": "1"}}
    first = {f"{largest} px": run(1.0, 1.0, **again) for largest in (192, *RANGES)}
    second = {f"{label}, seed 1": run(1.01, 1.25, seed=1, **again) for label in first}
    few = {"100 pairs": run(1.0, 1.0, **again), "100 pairs, seed 1": run(9.0, 9.0, seed=1, **again)}
    write_json(tmp_path / "paper" / "ablations.json", {"groups": {"range": first | second, "pairs": few}})
    methods = {"paper-192": run(1.0, 1.0), "anynet-published": run(1.1, 1.0), "patchmatch": {"noise": 1.2}}
    methods |= {"sgbm": {"noise": 1.6}, "psmnet": run(1.005, 1.0)}
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": methods})
    assert [line[1] for line in cells(tmp_path, "pictures")[2:]] == ["**held**", "**undecided**", "**undecided**"]


def test_records_of_different_kinds_are_refused(tmp_path, table1):
    table1["methods"]["wang2020"]["precision"], table1["methods"]["psmnet"]["precision"] = "bf16", "fp32"
    write_json(tmp_path / "paper" / "table1.json", table1)
    with pytest.raises(InvalidArgument, match=r"record: \w+ must have the precision of \w+ in table1\.json"):
        cells(tmp_path, "errors")


def test_a_method_that_only_a_smaller_table_has_is_judged_there(tmp_path, table1):
    write_json(tmp_path / "paper" / "table1_few.json", {**table1, "pairs": 16})
    del table1["methods"]["psmnet"]
    write_json(tmp_path / "paper" / "table1.json", table1)
    where = {line[1]: line[-1] for line in cells(tmp_path, "methods")[2:]}
    assert where[LABELS["psmnet"]] == "endosim-gi, first 16 |"
    assert where[LABELS["sgbm"]] == "endosim-gi |"


def test_another_rendering_of_the_same_pictures_counts(tmp_path, table1):
    """The errors of what needs no training tell: the files of another processor have another hash."""
    run = {**table1["methods"]["wang2020"], "epe": 0.1}
    again = {**table1, "sha256": "other", "methods": {"paper-192": run, "bm": table1["methods"]["bm"]}}
    write_json(tmp_path / "paper" / "table1.json", table1)
    write_json(tmp_path / "paper" / "table1_again.json", again)
    (found,) = (
        line
        for line in cells(tmp_path, "methods")
        if line[0][2:] == LABELS["paper-192"] and "PatchMatch" in line[1] and "px" in line[2]
    )
    assert (
        found[4].startswith("0.100 against 1.594") and found[-1] == "endosim-gi, rendered anew (other) and endosim-gi |"
    )

    other = {**again["methods"]["bm"], "epe": 1.01 * again["methods"]["bm"]["epe"]}
    for methods in ({**again["methods"], "bm": other}, {"paper-192": run}):
        write_json(tmp_path / "paper" / "table1_again.json", {**again, "methods": methods})
        assert LABELS["paper-192"] not in {line[0][2:] for line in cells(tmp_path, "methods")}


def test_pairs_that_were_rendered_anew_stand_apart(tmp_path, table1, shipped):
    methods = {"shipped-fast": {**shipped["shipped-fast"], "version": "11"}}
    for name, content in (("table1", table1), ("table1_again", {**table1, "sha256": "other", "methods": methods})):
        write_json(tmp_path / "paper" / f"{name}.json", content)
    rows = [line for line in cells(tmp_path, "errors") if line[1] == f"{table1['dataset']}, rendered anew (other)"]
    assert len(rows) == 1 and "version 11" in rows[0][0]
    assert [line[1] for line in cells(tmp_path, "sets")[2:]] == [table1["sha256"][:8], "other"]
    assert sum("version 11" in line[0] for line in cells(tmp_path, "runs")) == 1


def test_rows_timed_on_another_machine_say_so(tmp_path, table1):
    for name, values in table1["methods"].items():
        instructions = None if name != "sgbm" else ["avx2", "amx_int8"]
        values["timed_on"] = {"cpu": "Old", "instructions": instructions, "commit": name, "date": name}
    write_json(tmp_path / "paper" / "table1.json", table1)
    other = [line[0] for line in cells(tmp_path, "errors") if line[-1].endswith("(Old, avx2, amx_int8) |")]
    assert other == ["| StereoSGBM", "| StereoSGBM, holes left open"]
    assert cells(tmp_path, "sets")[2][5] == "Old"


@pytest.mark.parametrize(("reached", "verdict"), [(0.2, "**held**"), (0.2001, "**did not hold**")])
def test_our_own_recipe_is_judged_by_the_file_that_ships(reached, verdict, tmp_path):
    methods = {"wang2020": {"all": {"epe_px": reached}}}
    for sha256, mark in ((read_model("wang2020").sha256, ""), ("0" * 64, f" {records.STALE}")):
        record = {"models": {"wang2020": sha256}, "methods": methods}
        write_json(tmp_path / "accuracy" / "accuracy.json", record)
        (found,) = cells(tmp_path, "target")[2:]
        version = facts_of("wang2020")["endosdk.version"]
        assert found[:2] == [f"| {LABELS['shipped-wang2020']}, version {version}{mark}", verdict]
        assert found[2].startswith(f"{reached:.4f}, target 0.20")


def test_pixels_are_counted_with_and_without_occluded_ones(tmp_path):
    measures = {"epe_px": 0.5, **{f"kpe_{k}": 0.1 for k in KPE}, "coverage": 1.0, "pixels": 5000}
    scores = {"all": measures, "non_occluded": {**measures, "pixels": 4000}, "pairs": 2, "ms_median": 1.0}
    found = row(scores)
    assert (found["pixels"], found["pixels_noc"]) == (5000, 4000)
    table = {"dataset": "gi", "sha256": "1", "pairs": 2, "threads": 2, "methods": {"psmnet": found}}
    write_json(tmp_path / "paper" / "table1.json", table)
    assert cells(tmp_path, "sets")[2][2:5] == ["2", "5,000", "4,000"]


def test_the_origin_of_settings_is_named(tmp_path, table1):
    methods = {name: table1["methods"][name] for name in ("sgbm", "sgbm-hh")}
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": methods})
    assert [line[1] for line in cells(tmp_path, "search")[2:]] == ["not recorded"] * 2
    data = {"name": "gi", "split": "train", "sha256": 64 * "3"}
    methods["sgbm"]["settings"] = {"block_size": 11, "eight_paths": False}
    write_json(tmp_path / "paper" / "table1.json", {**table1, "methods": methods})
    forms = {
        "sgbm": {"best": methods["sgbm"]["settings"], "tried": [1, 2]},
        "sgbm-hh": {"best": {}, "tried": [1, 2, 3]},
    }
    search = {"forms": forms, "pairs": [str(i) for i in range(20)], "data": data}
    write_json(tmp_path / "paper" / "sgbm_search.json", search)
    assert [line[1:] for line in cells(tmp_path, "search")[2:]] == [
        ["2", "20 of the train split of gi", "block size 11 |"],
        ["not recorded", "", "|"],
    ]
