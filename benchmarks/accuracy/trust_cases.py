"""What happens to pairs in the bench of trust: spoilt pictures that can still be used, and faults that must be named.

A case takes a rectified sample with truth and a random generator, and gives the pair that the cameras would have given.
Lengths are px of a frame 960 wide.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from endosdk import Cause, DepthResult, Status
from endosdk.datasets.dataset import Sample
from endosdk.io.jpeg import as_jpeg
from endosdk.simulation.faults.field import Field, Label, darken_outside, inside, write_label
from endosdk.simulation.faults.rows import Rows, move_view

Picture = NDArray[np.uint8]
Spoil = Callable[[Sample, np.random.Generator], Sample]


@dataclass(frozen=True)
class Case:
    """One way to spoil pairs. A fault names the causes of which at least one must be raised; others are usable."""

    name: str
    spoil: Spoil
    causes: tuple[Cause, ...] = ()
    joins_another: bool = False  # the right view is that of another pair

    def pair(self, sample: Sample, another: Sample | None = None) -> Sample:
        """Spoil a sample, the same way every time. Raises ValueError where the case needs ``another`` and has none."""
        if self.joins_another:
            if another is None:
                raise ValueError(f"{self.name}: no pair of another scene")
            sample = replace(sample, right=another.right)
        seed = [zlib.crc32(sample.id.encode()), zlib.crc32(self.name.encode())]
        return self.spoil(sample, np.random.default_rng(seed))

    def named_by(self, answer: DepthResult) -> bool:
        """Whether the frame is not OK and names a cause of the case."""
        return answer.status != Status.OK and bool(set(answer.causes) & set(self.causes))


def next_scene(scenes: Sequence[str]) -> list[int | None]:
    """Return for each pair the number of the next one that shows another scene; after the last comes the first.

    ``scenes`` names what each pair shows. None: all show one.
    """
    count = len(scenes)
    orders = ([(number + step) % count for step in range(1, count)] for number in range(count))
    return [
        next((other for other in order if scenes[other] != scenes[number]), None) for number, order in enumerate(orders)
    ]


def _as_it_is(sample: Sample, rng: np.random.Generator) -> Sample:
    return sample


def _whole(picture: NDArray[np.floating]) -> Picture:
    return np.asarray(np.clip(picture + 0.5, 0, 255), np.uint8)


def _each(change: Callable[[Picture, np.random.Generator], Picture]) -> Spoil:
    """Both views, one after the other."""
    return lambda s, rng: replace(s, left=change(s.left, rng), right=change(s.right, rng))


def _right(change: Callable[[Picture, np.random.Generator], Picture]) -> Spoil:
    return lambda s, rng: replace(s, right=change(s.right, rng))


def _noise(levels: float) -> Callable[[Picture, np.random.Generator], Picture]:
    return lambda view, rng: _whole(view + levels * rng.standard_normal(view.shape, dtype=np.float32))


def _exposed(factor: float) -> Callable[[Picture, np.random.Generator], Picture]:
    return lambda view, rng: _whole(view * np.float32(factor))


def _blurred(px: float) -> Callable[[Picture, np.random.Generator], Picture]:
    return lambda view, rng: np.asarray(cv2.GaussianBlur(view, (0, 0), px * view.shape[1] / 960), np.uint8)


def _jpeg(quality: int) -> Callable[[Picture, np.random.Generator], Picture]:
    return lambda view, rng: as_jpeg(view, quality)


def _even(level: float, noise: float) -> Callable[[Picture, np.random.Generator], Picture]:
    """A covered lens: an even level under the noise of the chip."""
    return lambda view, rng: _whole(level + noise * rng.standard_normal(view.shape, dtype=np.float32))


def _rows_off(px: float) -> Spoil:
    return lambda s, rng: replace(s, right=_whole(move_view(s.right.astype(np.float32), Rows(px, 0.0, 0.0))))


def _field(shape: str, across: float) -> Spoil:
    """A field of view that is not the same in both eyes, dark and noisy outside."""

    def spoil(sample: Sample, rng: np.random.Generator) -> Sample:
        height, width = sample.left.shape[:2]
        views, seen = [], []
        for view in (sample.left, sample.right):
            x, y = rng.normal(0, 0.01, 2)
            down = across if shape in ("circle", "octagon") else across * height / width
            level, noise = rng.uniform(2, 12), rng.uniform(0.4, 3)
            field = Field(shape, 0.5 + x, 0.5 * height / width + y, across, down, level, noise)
            weight = inside(field, (height, width))
            views.append(_whole(darken_outside(view * weight[..., None], field, weight, rng)))
            seen.append(weight > 0.5)
        columns = np.indices((height, width))[1] - np.nan_to_num(sample.disparity)
        matched = np.take_along_axis(seen[1], np.clip(np.rint(columns), 0, width - 1).astype(np.int64), 1)
        truth = np.where(seen[0], sample.disparity, np.float32(np.nan))
        occlusion = None if sample.occlusion is None else sample.occlusion | ~matched
        info = {**sample.info, "outside": ~seen[0]}
        return replace(sample, left=views[0], right=views[1], disparity=truth, occlusion=occlusion, info=info)

    return spoil


def _overlaid(opacity: float) -> Spoil:
    """Five lines of text that a program draws into both frames, on a panel of this opacity."""

    def spoil(sample: Sample, rng: np.random.Generator) -> Sample:
        height, width = sample.left.shape[:2]
        x, y = float(rng.uniform(0.02, 0.5)), float(rng.uniform(0.05, 0.3))
        panel = np.s_[int((y - 0.04) * width) : int((y + 0.24) * width), int(x * width) : int((x + 0.4) * width)]
        words = rng.choice(("PATIENT", "LIGHT", "ZOOM", "EXPOSURE"), 5)
        lines = [Label(f"{word} {n}", x + 0.02, y + 0.05 * n, 0.022, 230.0, (0, 1)) for n, word in enumerate(words)]
        views = []
        covered = np.zeros((height, width), np.bool_)
        if opacity > 0:
            covered[panel] = True
        for view in (sample.left.astype(np.float32), sample.right.astype(np.float32)):
            view[panel] += opacity * (np.float32(35.0) - view[panel])
            for line in lines:
                covered |= write_label(view, line)
            views.append(_whole(view))
        truth = np.where(covered, np.float32(np.nan), sample.disparity)
        info = {**sample.info, "outside": covered}
        return replace(sample, left=views[0], right=views[1], disparity=truth, info=info)

    return spoil


def _glare(sample: Sample, rng: np.random.Generator) -> Sample:
    """Blown-out blots over three tenths of both views, at other places in each."""
    return _each(_blots)(sample, rng)


def _blots(view: Picture, rng: np.random.Generator) -> Picture:
    height, width = view.shape[:2]
    cloud = cv2.GaussianBlur(rng.standard_normal((height, width), dtype=np.float32), (0, 0), width / 24)
    over = (cloud - np.quantile(cloud, 0.7)) / cloud.std()
    return _whole(view + 600 * np.clip(over, 0, 1)[..., None])


def _fog(sample: Sample, rng: np.random.Generator) -> Sample:
    clear = np.float32(rng.uniform(0.25, 0.45))
    return _each(lambda view, _: _whole(160 + clear * (view.astype(np.float32) - 160)))(sample, rng)


def _turned(degrees: float, axis: int) -> Spoil:
    """The right camera turned about one of its axes: x, y or z."""

    def spoil(sample: Sample, rng: np.random.Generator) -> Sample:
        height, width = sample.right.shape[:2]
        focal = sample.focal_px
        matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        vector = np.zeros(3)
        vector[axis] = np.radians(degrees) * rng.choice([-1.0, 1.0])
        turn = matrix @ cv2.Rodrigues(vector)[0] @ np.linalg.inv(matrix)
        right = cv2.warpPerspective(sample.right, turn, (width, height), borderMode=cv2.BORDER_REPLICATE)
        return replace(sample, right=np.asarray(right, np.uint8))

    return spoil


def _scaled(scale: float) -> Spoil:
    """The right view of a camera with another focal length."""

    def spoil(sample: Sample, rng: np.random.Generator) -> Sample:
        height, width = sample.right.shape[:2]
        around = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), 0.0, scale)
        right = cv2.warpAffine(
            sample.right, around, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
        )
        return replace(sample, right=np.asarray(right, np.uint8))

    return spoil


def _fields_apart(px: float) -> Spoil:
    """Odd rows of a later moment, in which a camera that moves along the rows is so far on."""

    def moved(view: Picture, rng: np.random.Generator) -> Picture:
        frame = view.copy()
        frame[1::2] = np.roll(view, round(px * view.shape[1] / 960), axis=1)[1::2]
        return frame

    return _each(moved)


def _partly_covered(sample: Sample, rng: np.random.Generator) -> Sample:
    """Blood or a drop of fluid over the lower half of one lens."""
    right = sample.right.copy()
    half = right[right.shape[0] // 2 :]
    half[:] = _even(35.0, 2.0)(half, rng)
    return replace(sample, right=right)


def _bent(px: float) -> Callable[[Picture, np.random.Generator], Picture]:
    """Liquid on the lens: the picture is bent by so many px, standard deviation, over lengths of 60 px."""

    def bend(view: Picture, rng: np.random.Generator) -> Picture:
        height, width = view.shape[:2]
        y, x = np.indices((height, width), dtype=np.float32)
        waves = [cv2.GaussianBlur(rng.standard_normal((height, width), np.float32), (0, 0), 60) for _ in range(2)]
        along, down = (px * wave / wave.std() for wave in waves)
        return np.asarray(cv2.remap(view, x + along, y + down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT))

    return bend


def _torn_region(view: Picture, rng: np.random.Generator) -> Picture:
    """A part of the frame, a sixth of it, is of another moment: the camera stood 5 px aside and 5 px higher."""
    view, (height, width) = view.copy(), view.shape[:2]
    top, left = rng.integers(0, height * 6 // 10), rng.integers(0, width * 6 // 10)
    part = np.s_[top : top + height * 4 // 10, left : left + width * 4 // 10]
    view[part] = np.roll(view, (5, 5), axis=(0, 1))[part]
    return view


def _bit(sample: Sample, rng: np.random.Generator) -> Sample:
    right = sample.left.copy()
    right[0, 0, 0] ^= 1
    return replace(sample, right=right)


def _again(change: Callable[[Picture, np.random.Generator], Picture]) -> Spoil:
    return lambda s, rng: replace(s, right=change(s.left, rng))


def _swapped(sample: Sample, rng: np.random.Generator) -> Sample:
    return replace(sample, left=sample.right, right=sample.left)


def _upside_down(sample: Sample, rng: np.random.Generator) -> Sample:
    """A right camera that is read out from its last row to its first."""
    return replace(sample, right=np.ascontiguousarray(sample.right[::-1]))


USABLE = (
    Case("clean", _as_it_is),
    *(Case(f"noise of {n} grey levels", _each(_noise(n))) for n in (4, 8, 12)),
    Case("exposure x 0.25", _each(_exposed(0.25))),
    Case("exposure x 2", _each(_exposed(2.0))),
    *(Case(f"both views blurred by {n} px", _each(_blurred(n))) for n in (1, 2)),
    Case("JPEG of quality 20", _each(_jpeg(20))),
    Case("rows 2 px off", _rows_off(2.0)),
    Case("circular field of view", _field("circle", 0.4)),
    Case("field of view between bars", _field("bars", 0.42)),
    Case("text over both views", _overlaid(0.0)),
    Case("menu over both views", _overlaid(1.0)),
    Case("glare on 30 %", _glare),
    Case("fog", _fog),
)

FAULTS = (
    Case("right covered, black", _right(_even(3.0, 1.5)), (Cause.COVERED,)),
    Case("right covered, grey", _right(_even(128.0, 2.0)), (Cause.COVERED,)),
    Case("left covered, black", lambda s, rng: replace(s, left=_even(3.0, 1.5)(s.left, rng)), (Cause.COVERED,)),
    Case("lower half of the right covered", _partly_covered, (Cause.COVERED,)),
    Case("both dark", _each(_exposed(0.02)), (Cause.DIM,)),
    Case("both blown out", _each(_exposed(12.0)), (Cause.SATURATED,)),
    Case("right blurred by 4 px", _right(_blurred(4.0)), (Cause.BLURRED,)),
    Case("the left view twice, one bit changed", _bit, (Cause.SAME_VIEW_TWICE,)),
    Case("the left view twice, with noise of 6", _again(_noise(6)), (Cause.SAME_VIEW_TWICE,)),
    Case("the left view twice, as JPEG", _again(_jpeg(40)), (Cause.SAME_VIEW_TWICE,)),
    Case("views swapped", _swapped, (Cause.SWAPPED,)),
    Case("right view of another scene", _as_it_is, (Cause.VIEWS_DIFFER,), joins_another=True),
    Case("right view upside down", _upside_down, (Cause.VIEWS_DIFFER,)),
    Case("rows 12 px off", _rows_off(12.0), (Cause.NOT_RECTIFIED, Cause.RIG_MOVED)),
    *(
        Case(f"right camera {how} by {angle} degree", _turned(angle, axis), (Cause.RIG_MOVED,))
        for angle in (0.5, 1.0)
        for axis, how in enumerate(("pitched", "yawed", "rolled"))
    ),
    Case("right view larger by 1 %", _scaled(1.01), (Cause.SCALES_DIFFER,)),
    Case("fields 6 px apart", _fields_apart(6.0), (Cause.INTERLACED,)),
    *(Case(f"right bent by {n} px, as by liquid", _right(_bent(n)), (Cause.DISTORTED,)) for n in (2, 4)),
    Case("a part of the right from another moment", _right(_torn_region), (Cause.DISTORTED,)),
)  # fmt: skip
