"""Draw the faults of one pair, and spoil any rendered pair with them."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from endosdk.datasets.dataset import Sample, find_occlusion
from endosdk.simulation.faults.chips import (
    Chip,
    Picture,
    Processor,
    add_noise,
    dimming,
    draw_chips,
    draw_processor,
    process,
    take,
)
from endosdk.simulation.faults.colours import draw_look, recolour
from endosdk.simulation.faults.field import (
    Field,
    Label,
    darken_outside,
    draw_fields,
    draw_labels,
    inside,
    write_label,
)
from endosdk.simulation.faults.lens import (
    Droplet,
    Glint,
    Smoke,
    add_droplets,
    add_glints,
    add_smoke,
    draw_droplets,
    draw_glints,
    draw_smoke,
)
from endosdk.simulation.faults.rows import Rows, draw_rows, move_truth, move_view
from endosdk.simulation.noise import Array

CLEAN_SHARE = 0.08  # of the pairs have no faults at all
SHARES = {"smoke": 0.12, "droplets": 0.12, "glints": 0.35, "rows": 0.5, "fields": 0.3, "labels": 0.12}


@dataclass(frozen=True)
class Faults:
    """All that spoils one pair; None or nothing where a fault is absent."""

    look: str
    smoke: Smoke | None
    droplets: tuple[Droplet, ...]
    glints: tuple[Glint, ...]
    rows: Rows | None
    fields: tuple[Field, Field] | None
    labels: tuple[Label, ...]
    chips: tuple[Chip, Chip]
    processor: Processor

    def described(self) -> dict[str, Any]:
        """Return all of it as plain values."""
        return asdict(self)


def draw_faults(seed: tuple[int, ...], aspect: float) -> Faults | None:
    """Draw the faults of a pair whose height is ``aspect`` times its width; None leaves it clean."""
    rng = np.random.default_rng(seed)
    if rng.random() < CLEAN_SHARE:
        return None
    has = {name: bool(rng.random() < share) for name, share in SHARES.items()}
    return Faults(
        look=draw_look(rng),
        smoke=draw_smoke(rng) if has["smoke"] else None,
        droplets=draw_droplets(rng) if has["droplets"] else (),
        glints=draw_glints(rng) if has["glints"] else (),
        rows=draw_rows(rng) if has["rows"] else None,
        fields=draw_fields(rng, aspect) if has["fields"] else None,
        labels=draw_labels(rng, aspect) if has["labels"] else (),
        chips=draw_chips(rng),
        processor=draw_processor(rng),
    )


def spoil(sample: Sample, faults: Faults, seed: tuple[int, ...]) -> Sample:
    """Return the pair with its faults, which ``info`` records; a function of its arguments alone.

    The truth stays exact along the row; there is none outside the field of view of its eye and under labels.
    """
    truth = (sample.disparity, sample.disparity_right)
    views = [
        _before_the_chip(view.astype(np.float32), eye, truth, faults, seed)
        for eye, view in enumerate((sample.left, sample.right))
    ]
    right_truth = truth[1]
    if faults.rows is not None and right_truth is not None:
        right_truth = move_truth(right_truth, faults.rows)
    factor = dimming(views[0], faults.processor.level)
    pictures, kept, shown = [], [], []
    for eye, known in enumerate((truth[0], right_truth)):
        rng = np.random.default_rng((*seed, 1, eye))
        picture, seen = _on_the_chip(views[eye], eye, faults, factor, rng)
        pictures.append(picture)
        shown.append(seen)
        kept.append(None if known is None else np.where(seen, known, np.float32(np.nan)).astype(np.float32))
    assert kept[0] is not None
    if kept[1] is not None:
        occlusion = _occlusion(kept[0], kept[1], faults)
    elif sample.occlusion is not None:
        occlusion = sample.occlusion | ~shown[0] | _match_hidden(truth[0], shown[1], faults)
    else:
        occlusion = None
    return replace(
        sample,
        left=pictures[0],
        right=pictures[1],
        disparity=kept[0],
        disparity_right=kept[1],
        occlusion=occlusion,
        info={**sample.info, "faults": faults.described()},
    )


def _before_the_chip(
    view: Array, eye: int, truth: tuple[Array, Array | None], faults: Faults, seed: tuple[int, ...]
) -> Array:
    view = recolour(view, faults.look, (*seed, 2))
    own = truth[eye]
    if faults.smoke is not None:
        # An eye without truth of its own gets the smoke before a plane at the median of the left eye's depth.
        depth = own if own is not None else np.full(view.shape[:2], np.nanmedian(truth[0]), np.float32)
        view = add_smoke(view, depth, eye, faults.smoke, (*seed, 3))
    view = add_glints(view, truth[0], eye, faults.glints) if faults.glints else view
    if eye == 1 and faults.rows is not None:
        view = move_view(view, faults.rows)
    return add_droplets(view, eye, faults.droplets)


def _on_the_chip(
    view: Array, eye: int, faults: Faults, factor: float, rng: np.random.Generator
) -> tuple[Picture, np.ndarray]:
    """Return the picture and where [H,W] it shows the scene."""
    size = (view.shape[0], view.shape[1])
    seen = np.ones(size, np.bool_)
    view = take(view, faults.chips[eye], factor)
    weight = None if faults.fields is None else inside(faults.fields[eye], size)
    if weight is not None:
        view = view * weight[..., None]
    view = add_noise(view, faults.chips[eye], rng)
    if faults.fields is not None and weight is not None:
        view = darken_outside(view, faults.fields[eye], weight, rng)
        seen &= weight > 0.5
    for label in faults.labels:
        if eye in label.eyes:
            seen &= ~write_label(view, label)
    return process(view, faults.processor), seen


def _match_hidden(left: Array, shown: np.ndarray, faults: Faults) -> np.ndarray:
    """Return which points [H,W] of the left view have their match where the right one does not show the scene."""
    lines, columns = np.indices(left.shape)
    match = np.rint(columns - left)
    inside = (match >= 0) & (match < left.shape[1])
    match = np.where(inside, match, 0).astype(np.int64)
    if faults.rows is not None:
        down = np.rint(faults.rows.field((left.shape[0], left.shape[1]))[lines, match]).astype(np.int64)
        lines = lines + down
    in_frame = (lines >= 0) & (lines < left.shape[0])
    return np.asarray(inside & ~(in_frame & shown[np.where(in_frame, lines, 0), match]))


def _occlusion(left: Array, right: Array, faults: Faults) -> np.ndarray:
    """Return what [H,W] the right view does not show, found with the rows of the right truth moved back."""
    if faults.rows is not None:
        back = replace(faults.rows, shift=-faults.rows.shift, roll=-faults.rows.roll, scale=-faults.rows.scale)
        right = move_truth(right, back)
    return find_occlusion(left, right)
