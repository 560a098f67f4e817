"""Our models and StereoSGBM on the same pairs, none of which a model has seen: error, wrong pixels, edges, time.

    python -m benchmarks.accuracy.unseen_pairs --data DIR --models wang2020 --json FILE

Every measure stands for all pixels with truth and for parts of them: those that both views show and those that only
one does, those near a depth edge (with the flying pixels), those whose truth lies in the method's range, and those
that the method calls valid. StereoSGBM stands twice: with its holes filled, so that it answers every pixel as the
networks do, and as it is, where it leaves the pixels out that it does not trust.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.model_run import model_run
from benchmarks.record import write_record
from endosdk.datasets.layouts import default_split, open_dataset
from endosdk.evaluation.methods import estimator_method, evaluate, sgbm_method
from endosdk.evaluation.sgbm import SgbmSettings

PARTS = ("all", "non_occluded", "occluded", "edges", "in_range", "valid")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--layout", default="endosdk", help="how the data set is laid out")
    parser.add_argument("--split", help="default: the one with truth")
    parser.add_argument("--pairs", type=int, help="only the first so many pairs")
    parser.add_argument("--models", nargs="+", default=["wang2020"], help="shipped names or .onnx files")
    parser.add_argument("--sgbm-range", type=int, default=80, help="disparities that StereoSGBM tries, px")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    split = args.split or default_split(args.layout)
    reader = open_dataset(args.data, split, layout=args.layout)
    methods = {name: estimator_method(name) for name in args.models}
    sgbm = SgbmSettings(max_disparity=args.sgbm_range)
    methods |= {
        "sgbm-filled": sgbm_method(filled=True, settings=sgbm),
        "sgbm": sgbm_method(filled=False, settings=sgbm),
    }
    scores = {}
    for name, method in methods.items():
        print(name, file=sys.stderr)
        scores[name] = evaluate(method, reader, args.pairs)
    command = f"python -m benchmarks.accuracy.unseen_pairs --data {args.data.resolve().name} "
    command += f"--layout {args.layout} --split {split} --models {' '.join(args.models)} --sgbm-range {args.sgbm_range}"
    command += f" --pairs {args.pairs}" if args.pairs else ""
    dataset = {"name": reader.name, "split": split, "sha256": reader.sha256}
    hashes = {"models": {name: model_run(name).sha256 for name in args.models}}
    write_record(args.json, {"dataset": dataset, "methods": scores}, command=command, hashes=hashes)
    for name, score in scores.items():
        for part in PARTS:
            if score.get(part, {}).get("valid"):
                m = score[part]
                flying = f", flying {100 * m['flying']:.2f} %" if "flying" in m else ""
                print(
                    f"{name:12} {part:13} EPE {m['epe_px']:.3f} px, over 1 px {100 * m['kpe_1']:.2f} %, "
                    f"over 3 px {100 * m['kpe_3']:.2f} %{flying}, {100 * m['share']:.1f} % of all pixels, "
                    f"valid {100 * m['coverage']:.1f} % of {m['pixels']}"
                )


if __name__ == "__main__":
    main()
