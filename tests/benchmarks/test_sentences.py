"""Numbers that pages state in sentences, outside their tables, are those of the records."""

import re

import pytest

from benchmarks.tables import records


def of(name):
    return records.read(name)


def stream_and_single_gain():
    small, full = of("speed/fast-320"), of("speed/fast")
    return f"{small['fps'] / full['fps']:.1f}", f"{small['stream_fps'] / full['stream_fps']:.1f}"


def kernel_gains():
    (rectify,), (resize,) = (
        [
            one["times_faster"][rival]
            for one in of("speed/kernels")["results"]
            if (one["kernel"], one["size"], one["threads"]) == (kernel, "960x720", 1)
        ]
        for kernel, rival in (("rectify", "opencv"), ("resize_depth", "numpy"))
    )
    return f"{rectify:.1f}", f"{resize:.1f}"


def wider_margin():
    gains, losses = [], []
    for model in of("accuracy/range_end")["models"].values():
        half, whole = ({one["margin_px"]: one for one in model["margins"]}[margin] for margin in (0.5, 1.0))
        gains.append(100 * (whole["marked_of_surfaces_beyond"] - half["marked_of_surfaces_beyond"]))
        losses.append(whole["marked_of_right_answers"] / half["marked_of_right_answers"])
    return f"{min(gains):.0f}", f"{max(gains):.0f}", f"{max(losses):.1f}"


def valid_of_real_pairs():
    pairs = of("accuracy/photometric_consistency")["models"]["fast"]["real_pairs"]
    shares = [one["valid_with"] for one in pairs.values()]
    return f"{100 * min(shares):.0f}", f"{100 * max(shares):.0f}", f"{100 * pairs['hamlyn_phantom']['valid_with']:.0f}"


def kept_of_swapped():
    kept = {
        name: [one["valid_with"] for one in model["real_swapped"].values() if one["valid_with"] > 0]
        for name, model in of("accuracy/photometric_consistency")["models"].items()
    }
    assert not kept["fast"] and not kept["wang2020"] and len(kept["accurate"]) == 1
    return (f"{100 * kept['accurate'][0]:.0f}",)


def wrong_on_clean_pairs():
    clean = [of("accuracy/trust")["models"][name]["cases"]["clean"] for name in ("fast", "accurate")]
    shares = sorted(100 * one["wrong"] for one in clean)
    (valid,) = {f"{100 * one['wrong_of_valid']:.1f}" for one in clean}
    return f"{shares[0]:.1f}", f"{shares[1]:.1f}", valid


GAIN = r"(\d\.\d) times as fast, (\d\.\d) times in a stream"
SENTENCES = [
    ("README.md", GAIN, stream_and_single_gain),
    ("CHANGELOG.md", GAIN, stream_and_single_gain),
    ("models/fast-320.md", GAIN, stream_and_single_gain),
    (
        "docs/numbers.md",
        r"rectification is (\S+) times as fast .* resizing with depth (\S+) times as fast",
        kernel_gains,
    ),
    (
        "docs/numbers.md",
        r"difference between `fast` and eight-path StereoSGBM is (\S+) px",
        lambda: (f"{of('accuracy/real_pair')['difference_to_sgbm_hh_px']['median']:.2f}",),
    ),
    (
        "docs/numbers.md",
        r"median vertical disparity after rectification is (\S+) px",
        lambda: (f"{of('accuracy/chessboard_rectification')['row_difference_px']['median']:.2f}",),
    ),
    (
        "docs/live.md",
        r"open page lowers the frame rate by (\S+) %",
        lambda: (f"{100 * of('speed/viewer')['slowed_by']:.0f}",),
    ),
    (
        "docs/live.md",
        r"filter takes (\S+) % of the frame time",
        lambda: (f"{100 * of('speed/temporal')['share_of_a_frame']:.0f}",),
    ),
    (
        "docs/model-file.md",
        r"find (\S+) to (\S+) percentage points more, and lose up to (\S+) times as many",
        wider_margin,
    ),
    (
        "docs/trust.md",
        r"Unchanged, (\S+) to (\S+) % of the pixels are valid. The phantom pair has (\S+) %",
        valid_of_real_pairs,
    ),
    ("docs/trust.md", r"With `accurate`, one chessboard kept (\S+) %", kept_of_swapped),
    (
        "docs/trust.md",
        r"On clean pairs, (\S+) to (\S+) % of all pixels and (\S+) % of the valid pixels",
        wrong_on_clean_pairs,
    ),
]


@pytest.mark.parametrize(("page", "sentence", "measured"), SENTENCES)
def test_sentences_state_what_was_measured(page, sentence, measured):
    text = re.sub(r"\s+", " ", (records.SOURCES / page).read_text())
    stated = re.search(sentence, text)
    assert stated, "the sentence is gone"
    assert stated.groups() == measured()
