"""What joint bilateral upsampling of disparity gains over bilinear resizing, of the same answers.

    python -m benchmarks.studies.upsampling --data DIR --pairs 100 --json FILE

The network runs twice for each pair, inside the SDK and by itself on the same pictures. Where its answer is as large as
its input there is nothing to upsample, and both errors are the same.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from benchmarks.model_records import models_parser, record_models
from benchmarks.model_run import model_run
from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, _core
from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.scores import ScoreBoard
from endosdk.runtime.session import StereoSession, padded

COLUMNS = ("epe_px", "kpe_1", "kpe_2", "kpe_3", "kpe_5")


def measure(model: str, reader: DatasetReader, pairs: int) -> dict[str, Any]:
    """Errors of both ways over the first ``pairs`` of a split."""
    estimator = DepthEstimator(model, threads=2)
    session = StereoSession(model_run(model), threads=2)
    boards = {"bilinear": ScoreBoard(), "joint_bilateral": ScoreBoard()}
    for number in range(pairs):
        sample = reader[number]
        height, width = sample.left.shape[:2]
        found = estimator.predict(sample.left, sample.right)
        boards["joint_bilateral"].add(found.disparity, sample.disparity)
        seen = estimator.rectified_pair()
        multiple = session.info.input_multiple
        shown_height, shown_width = seen[0].shape[:2]
        run = NetworkRun(session, padded(shown_height, multiple), padded(shown_width, multiple))
        _core.pack(*seen, run.left, run.right, "rgb")
        run()
        resized = np.empty((height, width), np.float32)
        scales = (shown_height / height / session.info.output_stride, shown_width / width / session.info.output_stride)
        _core.resize_bilinear(run.disparity, resized, *scales, width / shown_width)
        boards["bilinear"].add(resized, sample.disparity)
        print(f"pair {number + 1} of {pairs}", file=sys.stderr)
    results = {way: board.result()["all"] for way, board in boards.items()}
    return {"pairs": pairs, **{way: {key: result[key] for key in COLUMNS} for way, result in results.items()}}


def main() -> None:
    args = models_parser(__doc__, "the first so many pairs").parse_args()
    reader = open_dataset(args.data, args.split)
    record_models(args, reader, lambda model: measure(model, reader, min(args.pairs, len(reader))))


if __name__ == "__main__":
    main()
