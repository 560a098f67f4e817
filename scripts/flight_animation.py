"""Make the animation of the documentation: a film, and its depth beside it, slowed or hastened to twenty seconds.

python scripts/flight_animation.py FILM --calibration rig.json --out docs/images/flight.webp

FILM is any source of `endosdk.open_source` that ends. The one shown was rendered by
`endosdk simulate --video --frames 160 --pairs 0 --test-pairs 1 --width 640 --height 480 --focal 500 --baseline 5
--max-disparity 69.5 --seed 77`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from endosdk import DepthEstimator, StereoCalibration, open_source
from endosdk.io.progress import progress
from endosdk.live.answers import answers
from endosdk.runtime.overview import preview

SECONDS = 20.0
WIDTH = 640  # px of the animation
QUALITY = 50
SETTLE = 0.1  # share of the way that the ends of the colour scale go in one frame towards those of the frame


def main() -> None:
    """Compute every frame and write the animation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("film", help="video with both views side by side")
    parser.add_argument("--calibration", type=Path, required=True)
    parser.add_argument("--model", default="fast", help="a shipped name")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    estimator = DepthEstimator(args.model, calibration=StereoCalibration.load(args.calibration))
    shown: list[Image.Image] = []
    ends = np.full(2, np.nan)
    with open_source(args.film) as source:
        for frame, result in progress(answers(estimator, source, temporal=True), unit="frame"):
            known = result.depth[np.isfinite(result.depth)]
            if len(known):
                now = np.percentile(known, (2, 98))
                ends = now if np.isnan(ends).any() else ends + SETTLE * (now - ends)
            picture = preview(frame.left, result, *ends)
            height = round(picture.shape[0] * WIDTH / picture.shape[1])
            shown.append(Image.fromarray(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)))
    step_ms = round(1000 * SECONDS / len(shown))
    shown[0].save(args.out, save_all=True, append_images=shown[1:], duration=step_ms, loop=0, quality=QUALITY, method=6)


if __name__ == "__main__":
    main()
