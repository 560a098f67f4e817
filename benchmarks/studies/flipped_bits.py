"""How many flipped bits of a model's weights the self test notices, of those that change the answer to real frames.

    python -m benchmarks.studies.flipped_bits --models fast accurate wang2020

A file with a flipped bit is refused when it is opened. Here bits flip afterwards, as they do in memory: the model is
taken for the one whose hash was checked. A flip is harmful where it moves the disparity of the demo pair by more than
1 px on more than 1 % of its pixels. Half of the flips are drawn from all bytes of numbers alike, the other half from
all tensors alike. The rule for models that are not shipped is tried on the same flips.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx

from benchmarks.network_run import NetworkRun
from benchmarks.record import write_part
from endosdk import DepthEstimator, StereoCalibration, _core
from endosdk.errors import SelfTestFailed
from endosdk.io.pictures import read_frame
from endosdk.io.progress import progress
from endosdk.runtime.limits import EVERY_DEPTH
from endosdk.runtime.models import ModelFile, read_model
from endosdk.runtime.session import StereoSession

RECORD = Path(__file__).parents[1] / "results" / "studies" / "flipped_bits.json"
SAMPLES = Path(__file__).parents[2] / "examples" / "data"
HARMFUL_PX = 1.0
HARMFUL_SHARE = 0.01
Map = npt.NDArray[np.float32]
NUMBERS = (onnx.TensorProto.FLOAT, onnx.TensorProto.INT8, onnx.TensorProto.INT32)


@dataclass(frozen=True)
class Flip:
    """One bit of one tensor of a model."""

    tensor: str
    byte: int
    bit: int


class Flipped:
    """A model in which one bit at a time is flipped."""

    def __init__(self, file: ModelFile) -> None:
        self.file = file
        self.model = onnx.load_from_string(file.data)
        tensors = [t for t in self.model.graph.initializer if t.data_type in NUMBERS and t.raw_data]
        self.tensors = {tensor.name: tensor for tensor in tensors}

    def drawn(self, count: int, seed: int) -> Iterator[Flip]:
        """Yield flips, half of them from all bytes alike, half from all tensors alike."""
        random = np.random.default_rng(seed)
        names = list(self.tensors)
        sizes = np.array([len(tensor.raw_data) for tensor in self.tensors.values()])
        for number in range(count):
            share = sizes / sizes.sum() if number % 2 else None
            name = names[random.choice(len(names), p=share)]
            byte = random.integers(len(self.tensors[name].raw_data))
            yield Flip(name, int(byte), int(random.integers(8)))

    def session(self, flip: Flip | None) -> StereoSession:
        """Return a session of the model with this bit flipped that states the hash of the model without."""
        if flip is None:
            return StereoSession(self.file)
        tensor = self.tensors[flip.tensor]
        whole = tensor.raw_data
        spoilt = bytearray(whole)
        spoilt[flip.byte] ^= 1 << flip.bit
        tensor.raw_data = bytes(spoilt)
        data = self.model.SerializeToString()
        tensor.raw_data = whole
        return StereoSession(replace(self.file, data=data))


def frame_path(session: StereoSession) -> _core.FramePath:
    """Return the frame path around a session, with every setting as usual."""
    settings = _core.FramePathSettings("rgb", 0, None, _core.default_min_confidence, EVERY_DEPTH, 0.0, 0.0)
    return _core.FramePath(session, settings)


def self_test_passes(session: StereoSession) -> bool:
    """Whether the self test finds nothing wrong. Raises what else it raises."""
    try:
        frame_path(session).self_test()
    except SelfTestFailed:
        return False
    return True


class RealPair:
    """The demo pair as a model sees it."""

    def __init__(self, session: StereoSession) -> None:
        rig = StereoCalibration.load(SAMPLES / "rig.json")
        frames = [read_frame(SAMPLES / "demo" / f"{side}.png") for side in ("left", "right")]
        with DepthEstimator(session.info.name, calibration=rig) as estimator:
            estimator.predict(*frames)
            views = estimator.rectified_pair()
        height, width = (
            side // session.info.input_multiple * session.info.input_multiple for side in views[0].shape[:2]
        )
        self.views = [view[:height, :width].transpose(2, 0, 1) for view in views]
        self.truth = self.disparity(session)

    def disparity(self, session: StereoSession) -> Map:
        """Return what a session finds, px of the network's input."""
        run = NetworkRun(session, *self.views[0].shape[1:])
        run.left[:], run.right[:] = self.views
        run()
        return run.disparity

    def is_changed(self, session: StereoSession) -> bool:
        """Whether a session's answer differs in more than a hundredth of the pixels."""
        moved = ~(np.abs(self.disparity(session) - self.truth) <= HARMFUL_PX)
        return bool(moved.mean() > HARMFUL_SHARE)


def tried(name: str, flips: int, seed: int) -> dict[str, Any]:
    """Count the flips of one model that are harmful, and those of them that are noticed."""
    model = Flipped(read_model(name))
    whole = model.session(None)
    if not self_test_passes(whole):
        raise RuntimeError(f"{name} does not pass its self test")
    pair = RealPair(whole)
    unknown = Flipped(replace(model.file, sha256="0" * 64))
    counts = {"flips": flips, "harmful": 0, "noticed": 0, "noticed_as_other_model": 0}
    for flip in progress(model.drawn(flips, seed), title=name, total=flips, unit="flip"):
        session = model.session(flip)
        if pair.is_changed(session):
            counts["harmful"] += 1
            counts["noticed"] += not self_test_passes(session)
            counts["noticed_as_other_model"] += not self_test_passes(unknown.session(flip))
    return counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=["fast", "accurate", "wang2020"])
    parser.add_argument("--flips", type=int, default=3000, help="of each model (default %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    for name in args.models:
        found = tried(name, args.flips, args.seed)
        print(f"{name:10} {found}")
        command = f"python -m benchmarks.studies.flipped_bits --models {name} --flips {args.flips} --seed {args.seed}"
        hashes = {"model_sha256": read_model(name).sha256}
        write_part(RECORD, name, found, command=command, hashes=hashes)


if __name__ == "__main__":
    main()
