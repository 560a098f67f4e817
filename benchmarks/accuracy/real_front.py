"""Does more compute buy real pairs? Errors of models that see them at several widths, on pairs with dense truth.

    python -m benchmarks.accuracy.real_front --data DIR --models fast@480 wide=fast@640 accurate@960 --json FILE

The front of `pareto_front` is of rendered pairs. This is its error on real ones, by the same names; the page joins the
two. Pairs differ in shape, so a width alone says at which size a model sees them, and the height follows.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from benchmarks.model_run import model_run
from benchmarks.record import as_given, write_record
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import default_split, open_dataset
from endosdk.evaluation.methods import Answer, Method, estimator_method, evaluate


def entry_of(given: str) -> tuple[str, str, int]:
    """Return name, file and width, px, of ``[NAME=]FILE@WIDTH``; without a name it is that of the file."""
    left, _, width = given.rpartition("@")
    name, _, file = left.rpartition("=")
    return name or file, file, int(width)


def seen_at(file: str, width: int) -> Method:
    """Return the method that is a model which sees frames at this width, px, in their own proportions."""
    by_size: dict[tuple[int, int], Method] = {}

    def answer(sample: Sample) -> Answer:
        rows, columns = sample.left.shape[:2]
        size = (width, round(width * rows / columns))
        if size not in by_size:
            by_size.clear()
            by_size[size] = estimator_method(file, network_size=size)
        return by_size[size](sample)

    return answer


def measure(method: Method, reader: DatasetReader) -> dict[str, Any]:
    """Return the share of pixels that lie in the method's range, and its errors over these."""
    part = evaluate(method, reader)["in_range"]
    return {"in_range": part["share"], **{key: part[key] for key in ("epe_px", "kpe_1", "kpe_3")}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--layout", default="plain", help="how the data set is laid out")
    parser.add_argument("--models", nargs="+", required=True, metavar="[NAME=]FILE@WIDTH")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    split = default_split(args.layout)
    reader = open_dataset(args.data, split, layout=args.layout)
    points: dict[str, dict[str, Any]] = {}
    hashes = {}
    for name, file, width in map(entry_of, args.models):
        hashes[name] = model_run(file).sha256
        points[name] = {"model": file, "network_width": width, **measure(seen_at(file, width), reader)}
        print(
            f"{name:14} over 3 px {100 * points[name]['kpe_3']:.2f} %, in range {100 * points[name]['in_range']:.1f} %"
        )
    command = f"python -m benchmarks.accuracy.real_front --data {args.data.resolve().name} --layout {args.layout} "
    command += f"--models {as_given(args.models)}"
    dataset = {"name": reader.name, "split": split, "pairs": len(reader), "sha256": reader.sha256}
    write_record(args.json, {"dataset": dataset, "points": points}, command=command, hashes={"models": hashes})


if __name__ == "__main__":
    main()
