"""Every cell of a table holds what its head says: records with another number in each field, and the cells as text.

`test_tables.py` compares the pages with what the same functions write, so a column that is taken from the wrong field
differs only here.
"""

import math
from enum import IntEnum
from types import SimpleNamespace

import pytest

from benchmarks.tables import attacks, codes, errors, ranges, records, speed, trust, video

PARTS = ("all", "non_occluded", "occluded", "edges", "in_range", "valid", "instrument_edges")
SHARES = ("kpe_1", "kpe_3", "coverage", "depth_relative", "flying", "share")


def columns(text):
    """Return the columns of a table, each with its head."""
    head, _, *rows = [line[1:-1].split("|") for line in text.splitlines() if line.startswith("|")]
    return list(zip(*([cell.strip() for cell in row] for row in (head, *rows)), strict=True))


def scores(method):
    """Return scores whose digits are the method's number, the part's and, in a share, the key's: 0.213 is 21.3 %."""
    return {
        part: {"epe_px": float(10 * method + p)}
        | {key: (100 * method + 10 * p + k) / 1000 for k, key in enumerate(SHARES, start=1)}
        for p, part in enumerate(PARTS, start=1)
    }


def run(number):
    """Return the record of a run of `endosdk-bench`; ``number`` is a multiple of 10."""
    return {
        "model": {"sha256": "abc"},
        "fps": number + 1.1,
        "stream_fps": number + 2.2,
        "latency_ms": {"p50": number + 3.3, "p95": number + 4.4, "p99": number + 5.6, "max": number + 6.7},
        "against": {"sgbm": {"fps": number + 7.8, "latency_ms": {"p50": number + 9.1}}},
        "peak_rss_mb": number + 8.9,
    }


@pytest.fixture
def given(monkeypatch):
    """Tables read the records that a test gives, and no others."""
    monkeypatch.setattr(records, "shipped", lambda: {"abc"})
    return lambda found: monkeypatch.setattr(records, "read", found.__getitem__)


def test_errors_of_methods(given):
    methods = {"sgbm": scores(2), "fast": scores(1)}
    given({"accuracy/accuracy": {"methods": methods, "models": {"fast": "abc"}}})
    assert columns(errors.accuracy_table()) == [
        ("method", "**fast** (8-bit)", "StereoSGBM"),
        ("EPE, px", "11.000", "21.000"),
        ("over 1 px", "11.1 %", "21.1 %"),
        ("over 3 px", "11.2 %", "21.2 %"),
        ("coverage", "11.3 %", "21.3 %"),
        ("EPE, non-occluded", "12.000", "22.000"),
        ("over 1 px, non-occluded", "12.1 %", "22.1 %"),
        ("depth error", "11.4 %", "21.4 %"),
    ]


def test_errors_that_the_readme_shows(given):
    names = ("sgbm-filled", "sgbm", "wang2020", "accurate", "fast-320", "fast-fp32", "fast")
    methods = {name: scores(number) for number, name in enumerate(names, start=1)}
    given({"accuracy/accuracy": {"methods": methods, "models": {}}})
    assert columns(errors.short_accuracy_table()) == [
        ("method", "**fast** (8-bit)", "fast-320 (8-bit)", "accurate (8-bit)", "wang2020", "StereoSGBM, filled"),
        ("mean error", "71.00 px", "51.00 px", "41.00 px", "31.00 px", "11.00 px"),
        ("over 3 px", "71.2 %", "51.2 %", "41.2 %", "31.2 %", "11.2 %"),
        ("depth error", "71.4 %", "51.4 %", "41.4 %", "31.4 %", "11.4 %"),
    ]


def test_errors_near_edges_and_where_one_camera_sees(given):
    given({"any": {"methods": {"wang2020": scores(1), "sgbm": scores(2)}, "models": {}}})
    assert columns(errors.edges_table("any")) == [
        ("method", "wang2020", "StereoSGBM"),
        ("EPE near edges, px", "14.00", "24.00"),
        ("over 3 px near edges", "14.2 %", "24.2 %"),
        ("flying pixels", "14.5 %", "24.5 %"),
        ("EPE near instrument edges, px", "17.00", "27.00"),
        ("over 3 px near these", "17.2 %", "27.2 %"),
        ("over 3 px, occluded", "13.2 %", "23.2 %"),
    ]


def test_errors_with_other_looks(given):
    looks = {"accurate": {"plain": {"epe_px": 0.5}, "grey": {"epe_px": 0.4}, "rows": {"epe_px": 0.75}}}
    looks["fast"] = {"plain": {"epe_px": 1.0}, "grey": {"epe_px": 1.234}, "rows": {"epe_px": 2.0}}
    given({"accuracy/looks": {"looks": looks, "models": {"fast": "abc", "accurate": "abc"}}})
    assert columns(errors.looks_table()) == [
        ("method", "**fast** (8-bit)", "accurate (8-bit)"),
        ("plain: EPE, px", "1.000", "0.500"),
        ("grey", "1.234 (+23 %)", "0.400 (-20 %)"),
        ("rows", "2.000 (+100 %)", "0.750 (+50 %)"),
    ]


def test_errors_by_what_a_method_answers_for(given):
    given({"any": {"methods": {"wang2020": scores(1), "sgbm": scores(2)}, "models": {}}})
    assert columns(errors.parts_table("any")) == [
        ("method", "wang2020", "StereoSGBM"),
        ("over 3 px", "11.2 %", "21.2 %"),
        ("non-occluded", "12.2 %", "22.2 %"),
        ("in range", "15.6 %", "25.6 %"),
        ("of these over 3 px", "15.2 %", "25.2 %"),
        ("valid", "16.6 %", "26.6 %"),
        ("of these over 3 px", "16.2 %", "26.2 %"),
    ]


def test_errors_on_real_pairs_and_times(given):
    def point(model, number):
        errors = {"epe_px": number + 0.125, "in_range": number / 100, "kpe_3": number / 1000}
        return {"model": model, "network_width": 100 * number, **errors}

    points = {"fast-320": point("fast-320", 1), "wide": point("fast", 2), "accurate": point("accurate", 3)}
    hashes = {"fast-320": "abc", "wide": "abc", "accurate": "abc"}
    # One was timed with another file, one not at all.
    timed = {
        "points": {"wide": {"ms": 41.4}, "fast-320": {"ms": 51.4}},
        "model_sha256": {"wide": "abc", "fast-320": "x"},
    }
    given({"accuracy/pareto_front_real": {"points": points, "models": hashes}, "accuracy/pareto_front": timed})
    assert columns(errors.real_front_table()) == [
        ("method", "fast-320 (8-bit)", "**fast** (8-bit)", "accurate (8-bit)"),
        ("inference width", "100 px", "200 px", "300 px"),
        ("time of a frame", "not timed", "41 ms", "not timed"),
        ("in range", "1.0 %", "2.0 %", "3.0 %"),
        ("EPE of these, px", "1.12", "2.12", "3.12"),
        ("over 3 px", "0.1 %", "0.2 %", "0.3 %"),
    ]


def test_errors_of_one_model_on_every_set(given):
    names = ("accuracy_lap_cycles", "accuracy_lap", "accuracy_cycles", "accuracy")
    methods = [{"fast": scores(number), "wang2020": scores(9)} for number in range(1, 5)]
    del methods[1]["fast"]  # not measured on this set
    sets = zip(names, methods, strict=True)
    given({f"accuracy/{name}": {"methods": found, "models": {"fast": "abc"}} for name, found in sets})
    rendered, path_traced = "`endosim-gi`, rendered, 100 pairs", "`endosim-gi-cycles`, path-traced, 60 pairs"
    assert columns(errors.errors_table("fast")) == [
        ("test set", rendered, path_traced, "`endosim-lap-cycles`, path-traced, 40 pairs"),
        ("EPE, px", "41.000", "31.000", "11.000"),
        ("over 1 px", "41.1 %", "31.1 %", "11.1 %"),
        ("over 3 px", "41.2 %", "31.2 %", "11.2 %"),
        ("EPE, non-occluded, px", "42.000", "32.000", "12.000"),
        ("depth error", "41.4 %", "31.4 %", "11.4 %"),
    ]


def test_errors_of_two_ways_of_upsampling(given):
    ways = {"bilinear": scores(1)["all"], "joint_bilateral": scores(2)["all"]}
    given({"studies/upsampling_cycles": {"models": {"fast-320": {"model_sha256": "abc", **ways}}}})
    assert columns(errors.upsampling_table()) == [
        ("method", "fast-320 (8-bit)"),
        ("EPE, bilinear, px", "11.000"),
        ("EPE, joint bilateral, px", "21.000"),
        ("over 3 px, bilinear", "11.2 %"),
        ("over 3 px, joint bilateral", "21.2 %"),
    ]


def test_errors_of_versions(given):
    told = {"phases": "1 to 3", "what_is_new": "more pairs"}
    sets = {"endosim-gi": scores(1)["all"], "endosim-gi-cycles": scores(2)["all"]}
    given({"studies/wang2020_versions": {"versions": {"7": told | sets}}})
    assert columns(errors.versions_table()) == [
        ("version", "7"),
        ("phases", "1 to 3"),
        ("new in the last one", "more pairs"),
        ("EPE, px", "11.000"),
        ("path-traced, px", "21.000"),
    ]


def test_range_of_a_model(monkeypatch):
    facts = {"endosdk.max_candidate_disparity": "96", "endosdk.inference_width": "480"}
    monkeypatch.setattr(ranges, "facts_of", lambda model: facts)
    monkeypatch.setattr(ranges, "_core", SimpleNamespace(range_margin=1.0))
    rigs = [f"nearest depth on {rig}" for rig in ranges.RIGS]
    stated, unstated = "% of the width", "% of the width, frames 960 px wide"
    assert columns(ranges.range_table("any")) == [
        ("what", f"range of disparities, {stated}", *rigs),
        ("value", "0 to 19.8", "20 mm", "26 mm", "22 mm"),
    ]
    del facts["endosdk.inference_width"]
    assert columns(ranges.range_table("any")) == [
        ("what", f"range of disparities, {unstated}", *rigs),
        ("value", "0 to 9.9", "40 mm", "51 mm", "43 mm"),
    ]


def test_end_of_the_range(given, monkeypatch):
    def margins(first):
        """Return a model's margins of 0 and 1 px, ten tenths of a percent apart."""
        keys = ("marked_of_surfaces_beyond", "beyond_the_max_candidate_disparity_of_marked", "marked_of_right_answers")
        keys += ("marked_of_right_answers_in_the_last_4_px", "marked_or_low_confidence_of_surfaces_beyond")
        of = [{key: (first + 10 * row + i) / 1000 for i, key in enumerate(keys)} for row in (0, 1)]
        return {"model_sha256": "abc", "margins": [{"margin_px": float(row), **one} for row, one in enumerate(of)]}

    monkeypatch.setattr(ranges, "_core", SimpleNamespace(range_margin=1.0))
    given({"accuracy/range_end": {"models": {"wang2020": margins(201), "fast": margins(101)}}})
    assert columns(ranges.range_end_table()) == [
        ("margin, px", "0", "**1**"),
        ("`fast`: much too near, and marked", "10.1 %", "**11.1 %**"),
        ("`fast`: of the marked, too near", "10.2 %", "**11.2 %**"),
        ("`fast`: correct pixels lost", "10.3 %", "**11.3 %**"),
        ("`wang2020`: much too near, and marked", "20.1 %", "**21.1 %**"),
        ("`wang2020`: of the marked, too near", "20.2 %", "**21.2 %**"),
        ("`wang2020`: correct pixels lost", "20.3 %", "**21.3 %**"),
    ]


def test_speed_that_the_readme_shows(given):
    names = ("accurate", "fast-320", "fast_1920x1080", "fast")
    given({f"speed/{name}": run(10 * number) for number, name in enumerate(names, start=1)})
    assert columns(speed.short_speed_table()) == [
        ("model, frames", "fast, 960 x 720", "fast, 1920 x 1080", "fast-320, 960 x 720", "accurate, 960 x 720"),
        ("`predict`, FPS", "41", "31", "21", "11"),
        ("`stream`, FPS", "42", "32", "22", "12"),
        ("StereoSGBM, FPS", "48", "38", "28", "18"),
    ]


def test_speed_of_runs(given):
    given({"one": run(10), "other": run(20)})
    assert columns(speed.speed_table({"other": "fast, 2", "one": "fast, 1"})) == [
        ("frames, threads", "fast, 2", "fast, 1"),
        ("`predict`, FPS", "21.1", "11.1"),
        ("`stream`, FPS", "22.2", "12.2"),
        ("median", "23.3 ms", "13.3 ms"),
        ("p99", "25.6 ms", "15.6 ms"),
        ("StereoSGBM, FPS", "27.8", "17.8"),
    ]


def test_speed_on_a_card(given):
    names = ("fast_1thread", "fast_1920x1080", "fast", "wang2020")
    given({f"speed/{name}": run(10 * (3 - number)) for number, name in enumerate(names)})
    assert columns(speed.card_speed_table("fast")) == [
        ("frames, threads", "960 x 720, 2", "1920 x 1080, 2", "960 x 720, 1"),
        ("`predict`, FPS", "11", "21", "31"),
        ("`stream`, FPS", "12", "22", "32"),
        ("median", "13 ms", "23 ms", "33 ms"),
        ("p99", "16 ms", "26 ms", "36 ms"),
        ("memory", "19 MB", "29 MB", "39 MB"),
    ]
    slow = dict(columns(speed.card_speed_table("wang2020")))
    assert slow["`predict`, FPS"] == "1.1" and slow["`stream`, FPS"] == "2.2"


def test_speed_of_variants_on_a_graphics_card(given):
    times = {"on_device_ms": {"p50": 1.1, "p99": 1.9}, "with_copies_ms": {"p50": 2.2, "p99": 2.9}}
    times |= {"with_page_locked_copies_ms": {"p50": 3.3, "p99": 3.9}, "parity": {"mean_px": 4e-6, "max_px": 5e-6}}
    ran = {"precision": "fp16", "options": {"graph": "1", "tf32": "0", "nhwc": "1"}, **times}
    failed = {"precision": "fp32", "options": {"graph": "0", "tf32": "1", "nhwc": "1"}, "failed": "memory"}
    found = {"models": {"fast-fp32": {"variants": [ran, failed]}}, "model_sha256": {"fast-fp32": "abc"}}
    given({"speed/h200_variants": found})
    assert columns(speed.gpu_variants_table()) == [
        ("model", "fast-fp32", "fast-fp32"),
        ("floats", "fp16", "fp32"),
        ("`graph`", "yes", "no"),
        ("`tf32`", "no", "yes"),
        ("time on the GPU", "1.1 ms", "did not run"),
        ("time with copies to and from it", "2.2 ms", "did not run"),
        ("mean difference from a CPU, px", "0.000004", "did not run"),
    ]


def test_speed_of_the_first_version(given):
    calls = {"before_ms": 1.1, "after_ms": 2.2, "ratio_quartiles": [3.33, 4.44, 5.55]}
    stream = {"before_ms": 6.6, "after_ms": 7.7, "ratio_quartiles": [8.11, 8.22, 8.33]}
    model = {"model": "fast", "size": [960, 720], "calls": calls, "stream": stream}
    given({"speed/first_version": {"models": [model], "model_sha256": {"fast": "abc"}}})
    assert columns(speed.first_version_table()) == [
        ("model, frames", "fast, 960 x 720"),
        ("`predict`, first", "1.1 ms"),
        ("`predict`, now", "2.2 ms"),
        ("`predict`, ratio", "4.44"),
        ("`stream`, first", "6.6 ms"),
        ("`stream`, now", "7.7 ms"),
        ("`stream`, ratio", "8.22"),
    ]


def test_frames_on_burdened_cores(given):
    found = {"model_sha256": "abc", "frames": 10_001, "latency_ms": {"p50": 1.1, "p99": 2.2, "max": 3.3}}
    found |= {"late": 4_004, "late_by_the_callers_clock": 5_005, "marked_in_time": 6_006, "late_and_unmarked": 7_007}
    found |= {"runs": 8, "memory_growth_mb": [9.1, 9.3, 9.2], "more_fd": 10, "more_task": 11}
    given({"speed/soak": found})
    what, value = columns(speed.soak_table())
    assert list(zip(what, value, strict=True)) == [
        ("measure", "value"),
        ("frames", "10,001"),
        ("latency, median / p99 / largest", "1 ms / 2 ms / 3 ms"),
        ("frames marked late", "4,004"),
        ("marked late, but in time by the caller's clock", "6,006"),
        ("late by the caller's clock, but not marked", "7,007"),
        ("starts, largest growth of memory after one", "8, 9.3 MB"),
        ("more open files, more threads", "10, 11"),
    ]


def test_instructions_on_arm(given):
    given({"speed/arm_instructions": {"instructions": {"resize": {"neon": 2_000, "plain": 7_000}}}})
    assert columns(speed.arm_instructions_table()) == [
        ("kernel", "`resize`"),
        ("plain", "7,000"),
        ("NEON", "2,000"),
        ("times fewer", "3.5"),
    ]


def test_files_of_a_release(given):
    wheel = {"kind": "wheel", "bytes": 1_230_000, "glibc": {"core.so": "2.27", "other.so": "2.17"}}
    archive = {"kind": "tarball", "bytes": 4_560_000, "glibc": {"core.so": "2.28", "other.so": "2.28"}}
    given({"speed/release_files": {"floor": "2.35", "files": {"a.whl": wheel, "a.tar.gz": archive}}})
    assert columns(speed.release_files_table()) == [
        ("file", "wheel", "tarball"),
        ("name", "`a.whl`", "`a.tar.gz`"),
        ("size", "1.2 MB", "4.6 MB"),
        ("needs glibc", "2.17, 2.27", "2.28"),
    ]


def judged(number, status, **more):
    """Return what a record of trust says of one case; the digits of a share are the case's number and the field's."""
    keys = ("right", "right_called_valid", "wrong", "wrong_called_valid", "wrong_of_valid", "within_sigma")
    shares = {key: (10 * number + i) / 1000 for i, key in enumerate((*keys, "within_two_sigma"), start=1)}
    return {"status": status, **shares, **more}


def test_trust_in_cases(given):
    cases = {
        "clean": judged(1, {"OK": 9}),
        "noise": judged(2, {"OK": 3, "DEGRADED": 6}),
        "covered": judged(3, {"INVALID": 9}, named=0.444),
    }
    models = {"fast": {"model_sha256": "abc", "cases": cases}, "accurate": {"cases": {}}}
    given({"accuracy/trust": {"models": models}})
    assert columns(trust.trust_table("fast")) == [
        ("pairs", "clean", "noise", "covered"),
        ("frames", "9 OK", "6 DEGRADED, 3 OK", "9 INVALID"),
        ("right pixels valid", "1.2 %", "2.2 %", ""),
        ("wrong pixels valid", "1.4 %", "2.4 %", ""),
        ("valid pixels that are wrong", "1.5 %", "2.5 %", "3.5 %"),
        ("error within sigma", "1.6 %", "2.6 %", ""),
        ("cause named", "", "", "44.4 %"),
    ]


def test_trust_on_a_card(given):
    clean, noise, packed = trust.CARD_CASES
    cases = {
        packed: judged(3, {"INVALID": 2, "OK": 7}),
        "covered": judged(4, {"INVALID": 9}, named=0.25),
        "swapped": judged(5, {"INVALID": 4, "DEGRADED": 5}, named=1.0),
        noise: judged(2, {"DEGRADED": 9}),
        "not on a card": judged(6, {"OK": 9}),
        clean: judged(1, {"OK": 9}),
    }
    given({"accuracy/trust": {"models": {"fast-320": {"model_sha256": "abc", "cases": cases}}}})
    assert columns(trust.card_trust_table("fast-320")) == [
        ("pairs", clean, noise, packed, "2 kinds of faults, named in 62.5 %"),
        ("frames", "9 OK", "9 DEGRADED", "2 INVALID, 7 OK", "5 DEGRADED, 13 INVALID"),
        ("right pixels valid", "1.2 %", "2.2 %", "3.2 %", ""),
        ("wrong pixels valid", "1.4 %", "2.4 %", "3.4 %", ""),
        ("error within sigma", "1.6 %", "2.6 %", "3.6 %", ""),
    ]


def test_trust_on_each_set(given):
    def case(number, **more):
        return {
            **{key: number / 100 for key in ("right_called_valid", "wrong_called_valid", "wrong_of_valid")},
            **{"confidence_ece": number / 1000, "ause": number / 10, "status": {"OK": 1}, **more},
        }

    cases = {"clean": case(1), "noise": case(2), "JPEG": case(4), "fog": case(6), "swapped": case(9, named=1.0)}
    models = {"fast": {"model_sha256": "abc", "cases": cases}, "fast-320": {"model_sha256": "abc", "cases": cases}}
    given({f"accuracy/{name}": {"models": models} for name in trust.TRUST_SETS})
    found = [line.split(" | ") for line in trust.trust_sets_table().splitlines() if line.startswith("|")][2:]
    assert len(found) == 2 * len(trust.TRUST_SETS) and {line[1] for line in found} == {"fast"}
    assert [line[2:] for line in found[:2]] == [
        ["1.0 %", "1.0 %", "1.0 %", "0.1 %", "0.10 |"],
        ["4.0 %", "4.0 %", "4.0 %", "0.4 %", "0.40 |"],
    ]


def test_trust_with_another_min_confidence(given):
    def case(number, **more):
        of = {
            at: {"right": (number + i) / 1000, "wrong": (number + 5 + i) / 1000} for i, at in enumerate(("0.5", "0.8"))
        }
        return {"called_valid_by_min_confidence": of, **more}

    def model(number):
        cases = {"clean": case(number), "a": case(number + 10), "b": case(number + 40), "c": case(number + 20)}
        return {"model_sha256": "abc", "cases": cases | {"covered": case(number + 90, named=1.0)}}

    given({"accuracy/trust": {"models": {"accurate": model(200), "fast-320": model(900), "fast": model(100)}}})
    assert columns(trust.min_confidence_table()) == [
        ("`min_confidence`", "0.5", "0.8"),
        ("fast, right, clean", "10.0 %", "10.1 %"),
        ("fast, right, degraded", "12.0 %", "12.1 %"),
        ("fast, wrong, clean", "10.5 %", "10.6 %"),
        ("fast, wrong, degraded", "12.5 %", "12.6 %"),
        ("accurate, right, clean", "20.0 %", "20.1 %"),
        ("accurate, right, degraded", "22.0 %", "22.1 %"),
        ("accurate, wrong, clean", "20.5 %", "20.6 %"),
        ("accurate, wrong, degraded", "22.5 %", "22.6 %"),
    ]


def test_faults_that_are_named(given):
    plain = {
        "one": {"frames": 10, "status": {"OK": 7, "DEGRADED": 2, "INVALID": 1}},
        "two": {"frames": 20, "status": {"OK": 20}},
        "hard": {"frames": 50, "status": {"DEGRADED": 11, "INVALID": 4, "OK": 35}},
        "worst": {"frames": 5, "status": {"INVALID": 5}},
    }
    covered = {
        name: {"frames": plain[name]["frames"], "named": named}
        for name, named in zip(plain, (1, 16, 42, 3), strict=True)
    }
    kinds = {name: {"pairs": kind} for name, kind in zip(plain, ("clean", "clean", "spoilt", "spoilt"), strict=True)}
    faults = {"covered": {"frames": 85, "named": 62, "sets": covered}}
    found = {"model_sha256": "abc", "datasets": kinds, "without_fault": plain, "faults": faults}
    given({"accuracy/fault_naming": found})
    assert columns(trust.fault_naming_table()) == [
        ("fault", "none: frames that are not OK", "covered"),
        ("of 30 clean pairs", "3", "17"),
        ("of 55 degraded pairs", "20", "45"),
    ]


def test_causes_and_reasons_of_the_core(monkeypatch):
    Cause = IntEnum("Cause", {"DIM": 4, "LATE": 5})
    dim = {"meaning": "dark", "measure": "grey", "bad": "low", "degraded": 1.5, "invalid": 2.5, "remedy": "a lamp"}
    late = {"meaning": "old", "measure": "age", "bad": "high", "degraded": 3.5, "invalid": math.nan, "remedy": "wait"}
    facts = {Cause.DIM: dim, Cause.LATE: late}
    reason = SimpleNamespace(value=8, name="GLARE", __doc__="too bright")
    monkeypatch.setattr(trust, "_core", SimpleNamespace(cause_facts=facts, Reason=[reason]))
    assert columns(trust.causes_table()) == [
        ("cause", "4 DIM", "5 LATE"),
        ("what it means", "dark", "old"),
        ("what is measured", "grey", "age"),
        ("DEGRADED", "below 1.5", "from 3.5"),
        ("INVALID", "below 2.5", "never"),
        ("what to do", "a lamp", "wait"),
    ]
    assert columns(trust.reasons_table()) == [("bit", "8"), ("reason", "`GLARE`"), ("what it means", "too bright")]


def test_codes_of_errors(monkeypatch):
    Code = IntEnum("Code", {"BIG": 3, "LATE": 7})

    class Base:
        pass

    class TooLate(Base):
        """The frame came
        late. Send it earlier. Or drop it.
        """

        code = Code.LATE

    class TooBig(Base):
        """It is too big. Make it smaller."""

        code = Code.BIG

    monkeypatch.setattr(codes, "EndoError", Base)
    assert columns(codes.error_codes_table()) == [
        ("number", "3", "7"),
        ("code", "`BIG`", "`LATE`"),
        ("what it means", "It is too big", "The frame came late"),
        ("what to do", "Make it smaller", "Send it earlier. Or drop it"),
    ]


def test_gains_of_the_filter_in_time(given):
    keys = ("flicker_ratio", "jump_ratio", "error_ratio", "jump_ratio_beside_the_tool", "jump_ratio_on_the_tool")
    keys += ("error_ratio_near_tool", "error_ratio_quick", "jump_ratio_at_the_pixel", "flicker_px", "jump_px")
    found = {
        kind: {
            film: {key: (shift + 10 * number + i) / 100 for i, key in enumerate(keys)}
            for film, shift in (("950002", 40), ("mean", 0), ("950003", -5))
        }
        for number, kind in enumerate(("tool", "flight", "still"), start=1)
    }

    def cell(mean):
        return f"{mean:.2f}, worst {mean + 0.4:.2f}"

    given({"accuracy/temporal": {"model_sha256": "abc", **found}})
    parts = ("flight with a moving tool", "beside the tool", "on the tool", "within 12 px of the tool")
    assert columns(video.temporal_table()) == [
        (
            "video",
            "the scene stands still",
            "flight",
            "flight, every fourth frame",
            *parts,
        ),
        ("flicker", cell(0.30), "", "", "", "", "", ""),
        ("jumps", cell(0.31), cell(0.21), "", cell(0.11), cell(0.13), cell(0.14), ""),
        ("error", cell(0.32), cell(0.22), cell(0.26), cell(0.12), "", "", cell(0.15)),
    ]


def test_intervals_of_measures(given):
    def measured(number):
        return {
            kind: {
                "measurements": 10 * number + i,
                "within_95": (100 * number + 10 * i + 1) / 1000,
                "rms_in_standard_errors": (100 * number + 10 * i + 2) / 1000,
                "median_relative_error": (100 * number + 10 * i + 3) / 1000,
            }
            for i, kind in enumerate(("relief", "area", "distance", "depth"))
        }

    gi = {"objects": {"polyp": 3, "instrument": 4}, "all": measured(1), "polyp": measured(5)}
    lap = {"objects": {"polyp": 5, "instrument": 6}, "all": measured(2), "polyp": measured(6)}
    given({"accuracy/measuring": {"model_sha256": "abc", "sets": {"gi": gi, "lap": lap}, "all": measured(3)}})
    kinds = ("depth of a point", "distance from edge to edge", "area", "relief")
    assert columns(video.measuring_table()) == [
        ("measured", *(kind for kind in kinds for _ in "ab")),
        ("set", *(4 * ("gi", "lap"))),
        ("objects in the set", *(4 * ("7", "11"))),
        ("times", "13", "23", "12", "22", "11", "21", "10", "20"),
        ("within the interval", "13.1 %", "23.1 %", "12.1 %", "22.1 %", "11.1 %", "21.1 %", "10.1 %", "20.1 %"),
        ("rms error, standard errors", "0.13", "0.23", "0.12", "0.22", "0.11", "0.21", "0.10", "0.20"),
        ("median error", "13.3 %", "23.3 %", "12.3 %", "22.3 %", "11.3 %", "21.3 %", "10.3 %", "20.3 %"),
    ]


def test_files_that_were_spoilt(given):
    outcomes = {"BAD_FILE": 60, "read": 25, "untyped ValueError": 3, "TOO_LARGE": 10, "untyped KeyError": 2}
    rig = {"tried": 100, "outcomes": outcomes, "slowest_s": 0.456}
    picture = {"tried": 7, "outcomes": {"BAD_FILE": 7}, "slowest_s": 0.789}
    machine = {"date": "2026-01-02T03:04:05Z", "commit": "abc"}
    given({"studies/spoilt_files": {"readers": {"rig": rig, "picture": picture}, "machine": machine}})
    assert columns(attacks.spoilt_files_table()) == [
        ("file", "rig", "picture"),
        ("tried", "100", "7"),
        ("still valid, read", "25", "0"),
        ("rejected with a typed error", "60 BAD_FILE, 10 TOO_LARGE", "7 BAD_FILE"),
        ("anything else", "5", "0"),
        ("slowest, s", "0.46", "0.79"),
    ]
    assert attacks.spoilt_files_table().endswith("\n\nRun on 2026-01-02, at commit `abc`.\n")


def test_input_that_was_fuzzed(given):
    targets = ("frame", "rig_file", "calibration", "model")
    result = {
        name: {"inputs": 1_000 * i, "edges_reached": 2_000 + i, "failures": i}
        for i, name in enumerate(targets, start=1)
    }
    machine = {"date": "2026-01-02T03:04:05Z", "commit": "abc+changes"}
    given({"speed/c_library": {"fuzz": {"result": result, "machine": machine}}})
    assert columns(attacks.fuzzed_table()) == [
        ("input", "pair of frames, with strides and formats", "rig file", "rig", "model file"),
        ("tried", "1,000", "2,000", "3,000", "4,000"),
        ("branches reached", "2,001", "2,002", "2,003", "2,004"),
        ("crashes, hangs, reports", "1", "2", "3", "4"),
    ]
    assert attacks.fuzzed_table().endswith("\n\nRun on 2026-01-02, at commit `abc` with changes.\n")


def test_files_of_tests_of_bad_input(tmp_path, monkeypatch):
    first, second, program = tmp_path / "test_a.py", tmp_path / "test_b.py", tmp_path / "test_c.cpp"
    first.write_text('"""Sizes."""\ndef test_one(): ...\n')
    second.write_text('"""Files."""\ndef test_one(): ...\ndef test_two(): ...\n')
    program.write_text("// Frames.\nvoid none() {}\nvoid other() {}\nint main() { none(); other(); }\n")
    monkeypatch.setattr(attacks, "SOURCES", tmp_path)
    monkeypatch.setattr(attacks, "ATTACKS", {"Python": [first, second], "C": [program]})
    assert columns(attacks.attacks_table()) == [
        ("interface", "Python", "Python", "**Python, together**", "C", "**C, together**"),
        ("file", "`test_a.py`", "`test_b.py`", "", "`test_c.cpp`", ""),
        ("what it tries", "Sizes.", "Files.", "", "Frames.", ""),
        ("tests", "1", "2", "**3**", "2", "**2**"),
    ]
