"""Frame rates and latency of the models, the soak, the instructions of the kernels, and the sizes of release files."""

from __future__ import annotations

from benchmarks.tables import records
from benchmarks.tables.markdown import table

VNNI_SPEEDS = {
    "speed/fast": "fast, 960 x 720, 2",
    "speed/fast_1280x720": "fast, 1280 x 720, 2",
    "speed/fast_1920x1080": "fast, 1920 x 1080, 2",
    "speed/fast_3840x2160": "fast, 3840 x 2160, 2",
    "speed/fast_1thread": "fast, 960 x 720, 1",
    "speed/fast-320": "fast-320, 960 x 720, 2",
    "speed/accurate": "accurate, 960 x 720, 2",
    "speed/fast-fp32": "fast-fp32, 960 x 720, 2",
    "speed/wang2020": "wang2020, 960 x 720, 2",
}
ZEN3_SPEEDS = {
    "history/speed/zen3_fast": "fast, 960 x 720, 2",
    "history/speed/zen3_fast_1280x720": "fast, 1280 x 720, 2",
    "history/speed/zen3_fast_1920x1080": "fast, 1920 x 1080, 2",
    "history/speed/zen3_fast_3840x2160": "fast, 3840 x 2160, 2",
    "history/speed/zen3_fast_1thread": "fast, 960 x 720, 1",
    "history/speed/zen3_fast-320": "fast-320, 960 x 720, 2",
    "history/speed/zen3_accurate": "accurate, 960 x 720, 2",
}
GPU_SPEEDS = {
    "speed/h200_fast-fp32": "fast-fp32, 960 x 720, 2",
    "speed/h200_accurate-fp32": "accurate-fp32, 960 x 720, 2",
}
SHORT_SPEEDS = {
    "fast": "fast, 960 x 720",
    "fast_1920x1080": "fast, 1920 x 1080",
    "fast-320": "fast-320, 960 x 720",
    "accurate": "accurate, 960 x 720",
}
# What a card shows of the speed.
CARD_SPEEDS = {
    "fast": ("fast", "fast_1920x1080", "fast_1thread"),
    "fast-320": ("fast-320",),
    "accurate": ("accurate",),
    "wang2020": ("wang2020",),
}


def short_speed_table() -> str:
    """What a reader wants to know first: frame rates of our models, each with StereoSGBM in the same run."""
    rows = []
    for name, label in SHORT_SPEEDS.items():
        run = records.read(f"speed/{name}")
        rates = (run["fps"], run["stream_fps"], run["against"]["sgbm"]["fps"])
        rows.append([records.marked(label, run["model"]["sha256"]), *(f"{rate:.0f}" for rate in rates)])
    return table(["model, frames", "`predict`, FPS", "`stream`, FPS", "StereoSGBM, FPS"], rows)


def speed_table(runs: dict[str, str]) -> str:
    """Frame rates of our models, each with StereoSGBM in the same run; record and label of every run."""
    rows = []
    for name, label in runs.items():
        run = records.read(name)
        delay, sgbm = run["latency_ms"], run["against"]["sgbm"]["fps"]
        rates = [f"{run['fps']:.1f}", f"{run['stream_fps']:.1f}"]
        marked = records.marked(label, run["model"]["sha256"])
        rows.append([marked, *rates, f"{delay['p50']:.1f} ms", f"{delay['p99']:.1f} ms", f"{sgbm:.1f}"])
    heads = ["frames, threads", "`predict`, FPS", "`stream`, FPS", "median", "p99", "StereoSGBM, FPS"]
    return table(heads, rows)


def gpu_variants_table() -> str:
    """The network alone on a graphics card: precision, options of the provider, and how far its answers are off."""
    run = records.read("speed/h200_variants")
    variants = [(name, found) for name, model in run["models"].items() for found in model["variants"]]
    every = [found["options"] for _, found in variants]
    swept = [option for option in every[0] if len({options[option] for options in every}) > 1]
    rows = []
    for name, found in variants:
        told = ["yes" if found["options"][option] == "1" else "no" for option in swept]
        cells = ["did not run"] * 3
        if "failed" not in found:
            cells = [f"{found[key]['p50']:.1f} ms" for key in ("on_device_ms", "with_copies_ms")]
            cells.append(f"{found['parity']['mean_px']:.6f}")
        rows.append([records.marked(name, run["model_sha256"][name]), found["precision"], *told, *cells])
    heads = ["model", "floats", *(f"`{option}`" for option in swept)]
    return table([*heads, "time on the GPU", "time with copies to and from it", "mean difference from a CPU, px"], rows)


def card_speed_table(model: str) -> str:
    """Frame rates, latency and memory of one model."""
    rows = []
    for name in CARD_SPEEDS[model]:
        label = VNNI_SPEEDS[f"speed/{name}"]
        run = records.read(f"speed/{name}")
        frames = records.marked(label.removeprefix(f"{model}, "), run["model"]["sha256"])
        rates = [f"{run[key]:.0f}" if run[key] >= 10 else f"{run[key]:.1f}" for key in ("fps", "stream_fps")]
        delays = [f"{run['latency_ms'][key]:.0f} ms" for key in ("p50", "p99")]
        rows.append([frames, *rates, *delays, f"{run['peak_rss_mb']:.0f} MB"])
    return table(["frames, threads", "`predict`, FPS", "`stream`, FPS", "median", "p99", "memory"], rows)


def first_version_table() -> str:
    """Times of a frame of the first version and of a later one, in turns."""
    run = records.read("speed/first_version")
    rows = []
    for found in run["models"]:
        width, height = found["size"]
        label = records.marked(f"{found['model']}, {width} x {height}", run["model_sha256"][found["model"]])
        cells = []
        for kind in ("calls", "stream"):
            times = found[kind]
            cells += [f"{times[name]:.1f} ms" for name in ("before_ms", "after_ms")]
            cells.append(f"{times['ratio_quartiles'][1]:.2f}")
        rows.append([label, *cells])
    heads = [f"`{kind}`, {what}" for kind in ("predict", "stream") for what in ("first", "now", "ratio")]
    return table(["model, frames", *heads], rows)


def soak_table() -> str:
    """What a hundred thousand frames on burdened cores showed."""
    run = records.read("speed/soak")
    delay = run["latency_ms"]
    rows = [
        ["frames", f"{run['frames']:,}"],
        ["latency, median / p99 / largest", " / ".join(f"{delay[key]:.0f} ms" for key in ("p50", "p99", "max"))],
        ["frames marked late", f"{run['late']:,}"],
        ["marked late, but in time by the caller's clock", f"{run['marked_in_time']:,}"],
        ["late by the caller's clock, but not marked", f"{run['late_and_unmarked']:,}"],
        ["starts, largest growth of memory after one", f"{run['runs']}, {max(run['memory_growth_mb']):.1f} MB"],
        ["more open files, more threads", f"{run['more_fd']:.0f}, {run['more_task']:.0f}"],
    ]
    return table(["measure", records.marked("value", run["model_sha256"])], rows)


def real_time_priority_table() -> str:
    """Time of a frame with the usual priority and with a real-time one, beside busy processes."""
    run = records.read("speed/real_time_priority")
    rows = [
        [f"`{policy}`", *(f"{spread[key]:.0f} ms" for key in ("p50_ms", "p99_ms", "max_ms"))]
        for policy, spread in run["policies"].items()
    ]
    return table([records.marked("policy", run["model_sha256"]["fast"]), "median", "p99", "largest"], rows)


def arm_instructions_table() -> str:
    """Instructions that each kernel takes on 64-bit ARM, plain and with NEON."""
    rows = [
        [f"`{name}`", f"{counts['plain']:,}", f"{counts['neon']:,}", f"{counts['plain'] / counts['neon']:.1f}"]
        for name, counts in records.read("speed/arm_instructions")["instructions"].items()
    ]
    return table(["kernel", "plain", "NEON", "times fewer"], rows)


def release_files_table() -> str:
    """The files of a release for Linux on x86-64: size, and the newest glibc that a library inside needs."""
    rows = [
        [file["kind"], f"`{name}`", f"{file['bytes'] / 1e6:.1f} MB", ", ".join(sorted(set(file["glibc"].values())))]
        for name, file in records.read("speed/release_files")["files"].items()
    ]
    return table(["file", "name", "size", "needs glibc"], rows)
