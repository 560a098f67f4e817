"""Numbers that pages state in sentences, outside their tables, are those of the records."""

import re

import pytest

from benchmarks.tables.ranges import WIDEST_UNRESIZED, facts_of, largest_disparity
from benchmarks.tables.records import SOURCES, read


def stated_as(form, name, *keys):
    """Return what gives one number of a record, as the page writes it."""

    def measured():
        value = read(name)
        for key in keys:
            value = value[key]
        return (form(value),)

    return measured


def hundredths(value):
    return f"{value:.2f}"


def whole_percent(share):
    return f"{100 * share:.0f}"


def gains_of_fast_320():
    small, full = read("speed/fast-320"), read("speed/fast")
    return f"{small['fps'] / full['fps']:.1f}", f"{small['stream_fps'] / full['stream_fps']:.1f}"


def kernel_gains(threads):
    """By how much each kernel is faster than the fastest rival."""

    def measured():
        rectify, resize = (
            min(one["times_faster"].values())
            for kernel in ("rectify", "resize_depth")
            for one in read("speed/kernels")["results"]
            if (one["kernel"], one["size"], one["threads"]) == (kernel, "960x720", threads)
        )
        return f"{rectify:.1f}", f"{resize:.1f}"

    return measured


def range_of(model):
    """Its width at the network's input, and the end of its range, as `docs/models.md` has them."""

    def stated():
        facts = facts_of(model)
        width = facts.get("endosdk.inference_width", str(WIDEST_UNRESIZED))
        return width, f"{100 * largest_disparity(facts) / int(width):.1f}"

    return stated


def late_frames_of_the_soak():
    found = read("speed/soak")
    assert "--deadline-ms 50" in found["command"] and found["beside"][0] == "2 busy processes"
    return f"{found['late']:,}", f"{found['frames']:,}", str(found["late_and_unmarked"])


def fine_tuning_rate():
    return (f"{read('studies/fine_tune')['recipe']['rate']:.1e}".replace("e-0", "e-"),)


def wider_margin():
    gains, losses = [], []
    for model in read("accuracy/range_end")["models"].values():
        half, whole = ({one["margin_px"]: one for one in model["margins"]}[margin] for margin in (0.5, 1.0))
        gains.append(100 * (whole["marked_of_surfaces_beyond"] - half["marked_of_surfaces_beyond"]))
        losses.append(whole["marked_of_right_answers"] / half["marked_of_right_answers"])
    return f"{min(gains):.1f}", f"{max(gains):.1f}", f"{max(losses):.1f}"


def valid_of_real_pairs():
    pairs = read("accuracy/photometric_consistency")["models"]["fast"]["real_pairs"]
    shares = [one["valid_with"] for one in pairs.values()]
    return whole_percent(min(shares)), whole_percent(max(shares)), whole_percent(pairs["hamlyn_phantom"]["valid_with"])


def kept_of_swapped():
    kept = {
        name: [one["valid_with"] for one in model["real_swapped"].values() if one["valid_with"] > 0]
        for name, model in read("accuracy/photometric_consistency")["models"].items()
    }
    assert not kept["wang2020"] and not kept["fast"] and len(kept["accurate"]) == 1
    return (whole_percent(kept["accurate"][0]),)


def wrong_on_clean_pairs():
    clean = [read("accuracy/trust")["models"][name]["cases"]["clean"] for name in ("fast", "accurate")]
    shares = sorted(100 * one["wrong"] for one in clean)
    valid = sorted(100 * one["wrong_of_valid"] for one in clean)
    return f"{shares[0]:.2f}", f"{shares[1]:.2f}", f"{valid[0]:.2f}", f"{valid[1]:.2f}"


def gain_of_a_larger_network_size():
    points = read("accuracy/pareto_front")["points"]
    usual, wide = points["fast"], points["wide"]
    end = largest_disparity(facts_of("fast")) / 640
    return f"{usual['epe_px']:.3f}", f"{wide['epe_px']:.3f}", f"{wide['ms'] / usual['ms']:.1f}", f"{100 * end:.1f}"


def rates_with_avx2():
    models = read("speed/avx2_only")["models"]
    return tuple(f"{models[name]['AVX2 alone']['fps']:.0f}" for name in ("fast", "fast-320"))


def rates_of_a_zen_3():
    return tuple(f"{read(f'history/speed/zen3_{name}')['fps']:.0f}" for name in ("fast", "fast-320"))


def rates_beside_a_busy_process():
    one = read("speed/spinning")["models"]["fast"]["1 busy processes"]
    return tuple(f"{one[way]['fps']:.0f}" for way in ("sleeping", "polling"))


def times_of_fast_alone():
    alone = read("speed/spinning")["models"]["fast"]["0 busy processes"]
    return tuple(f"{alone[way]['p50_ms']:.1f}" for way in ("sleeping", "polling"))


def rates_beside_two_busy_processes():
    two = read("speed/spinning")["models"]["fast"]["2 busy processes"]
    return tuple(sorted(f"{two[way]['fps']:.0f}" for way in ("sleeping", "polling")))


def outlines_rejected():
    found = read("accuracy/measuring")
    objects = sum(sum(one["objects"].values()) for one in found["sets"].values())
    return str(objects - found["all"]["area"]["measurements"]), str(objects)


def loss_on_one_flight():
    ratios = sorted(one["error_ratio"] for film, one in read("accuracy/temporal")["flight"].items() if film != "mean")
    assert sum(ratio > 1.03 for ratio in ratios) == 1 and len(ratios) == 5
    return (whole_percent(ratios[-1] - 1),)


def named_scale():
    found = read("accuracy/fault_naming")
    sets = found["faults"]["right view larger by 1 %"]["sets"]
    clean = [one for name, one in sets.items() if found["datasets"][name]["pairs"] == "clean"]
    return tuple(str(sum(one[key] for one in clean)) for key in ("named", "frames"))


def false_alarms():
    (found,) = read("accuracy/fault_naming")["further"].values()
    alarms = found["frames"] - found["status"]["OK"]
    assert alarms == 0  # another bound holds for others
    return str(found["frames"]), str(alarms), str(int(1 / (1 - 0.05 ** (1 / found["frames"]))))


def changes_by_fine_tuning():
    found = read("studies/fine_tune")
    assert (found["dataset"]["pairs"], found["dataset"]["held_out"]) == (16, 16)
    recipe, defaults = ([100 * one["change"] for one in found["after"][way].values()] for way in ("recipe", "defaults"))
    assert len(recipe) == 3
    return f"{min(recipe):.1f}", f"{max(recipe):.1f}", f"{max(defaults):.0f}"


def cost_of_trust():
    shares = [case["share_of_a_frame"] for case in read("speed/trust_cost")["cases"].values()]
    return f"{100 * min(shares):.1f}", f"{100 * max(shares):.1f}"


def noticed_flips():
    found = read("studies/flipped_bits")["fast"]
    harmful = str(found["harmful"])
    return str(found["noticed"]), harmful, str(found["noticed_as_other_model"]), harmful


GAIN = r"(\d\.\d) times as fast, (\d\.\d) times in a stream"
SENTENCES = [
    ("README.md", GAIN, gains_of_fast_320),
    ("CHANGELOG.md", GAIN, gains_of_fast_320),
    ("models/fast-320.md", GAIN, gains_of_fast_320),
    (
        "docs/numbers.md",
        r"rectification is (\S+) times as fast .* resizing with depth (\S+) times as fast",
        kernel_gains(2),
    ),
    ("docs/numbers.md", r"On one thread, the factors are (\S+) and (\d\.\d)\.", kernel_gains(1)),
    *(
        ("docs/models.md", rf"\| `{model}` \| (\d+) px \| 0 to (\S+) \|", range_of(model))
        for model in ("fast", "fast-320", "accurate")
    ),
    ("docs/models.md", r"`wang2020` \| that of the frame up to (\d+) px; .* \| 0 to (\S+), in", range_of("wang2020")),
    (
        "docs/limits.md",
        r"(\S+) of (\S+) frames missed a deadline of 50 ms and were marked\. Another (\S+) were late",
        late_frames_of_the_soak,
    ),
    (
        "docs/hardening.md",
        r"found (\S+) of (\S+) harmful flips of `fast`\..* alone finds (\S+) of the (\S+) flips of `fast`",
        noticed_flips,
    ),
    ("docs/train.md", r"measured fine-tuning of `fast` with a learning rate of (\S+),", fine_tuning_rate),
    (
        "docs/numbers.md",
        r"`fast` falls from (\S+) to (\S+) px on these pairs\. "
        r"A frame takes (\S+) times as long\. The range then ends at (\S+) %",
        gain_of_a_larger_network_size,
    ),
    ("docs/numbers.md", r"this CPU ran `fast` at (\S+) FPS and `fast-320` at (\S+) FPS", rates_with_avx2),
    ("docs/numbers.md", r"file of `fast` at (\S+) FPS, and of `fast-320` at (\S+) FPS", rates_of_a_zen_3),
    ("docs/real-time.md", r"`fast` runs at (\S+) FPS without and at (\S+) FPS with", rates_beside_a_busy_process),
    ("docs/real-time.md", r"Beside two, both run at (\S+) to (\S+) FPS", rates_beside_two_busy_processes),
    ("docs/real-time.md", r"trust checks take (\S+) to (\S+) % of a frame", cost_of_trust),
    (
        "docs/train.md",
        r"on 16 others is (\S+) to (\S+) % larger, with three seeds .* settings of a new network it is (\S+) % larger",
        changes_by_fine_tuning,
    ),
    ("docs/measuring.md", r"happened for (\S+) of (\S+) outlines", outlines_rejected),
    ("docs/live.md", r"In one of the five flights, the filter raises the error by (\S+) %", loss_on_one_flight),
    ("docs/trust.md", r"A difference of 1 % is named in (\S+) of (\S+) clean frames", named_scale),
    ("docs/real-time.md", r"a frame of `fast` takes (\S+) ms without and (\S+) ms with", times_of_fast_alone),
    (
        "docs/numbers.md",
        r"difference between `fast` and eight-path StereoSGBM is (\S+) px",
        stated_as(hundredths, "accuracy/real_pair", "difference_to_sgbm_hh_px", "median"),
    ),
    (
        "docs/numbers.md",
        r"median vertical disparity after rectification is (\S+) px",
        stated_as(hundredths, "accuracy/chessboard_rectification", "row_difference_px", "median"),
    ),
    (
        "docs/live.md",
        r"open page lowers the frame rate by (\S+) %",
        stated_as(whole_percent, "speed/viewer", "slowed_by"),
    ),
    (
        "docs/live.md",
        r"filter takes (\S+) % of the frame time",
        stated_as(whole_percent, "speed/temporal", "share_of_a_frame"),
    ),
    (
        "docs/range.md",
        r"find (\S+) to (\S+) percentage points more, and lose up to (\S+) times as many",
        wider_margin,
    ),
    (
        "docs/trust.md",
        r"Unchanged, (\S+) to (\S+) % of the pixels are valid. The phantom pair has (\S+) %",
        valid_of_real_pairs,
    ),
    ("docs/trust.md", r"With `accurate`, one chessboard kept (\S+) % of its pixels", kept_of_swapped),
    (
        "docs/trust.md",
        r"On clean pairs, (\S+) to (\S+) % of all pixels and (\S+) to (\S+) % of the valid pixels",
        wrong_on_clean_pairs,
    ),
    (
        "docs/trust.md",
        r"Of (\S+) further clean pairs, with other scenes and rigs, (\S+) raised a cause. .* below 1 in (\S+), with 95",
        false_alarms,
    ),
]


@pytest.mark.parametrize(("page", "sentence", "measured"), SENTENCES)
def test_sentences_state_what_was_measured(page, sentence, measured):
    text = re.sub(r"\s+", " ", (SOURCES / page).read_text())
    stated = re.search(sentence, text)
    assert stated, "the sentence is gone"
    assert stated.groups() == measured()
