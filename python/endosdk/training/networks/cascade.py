"""`Fast` on a smaller frame, then two looks at the frame's own width.

The first stage has the range and the surroundings at half of the cost. What it leaves open are fractions of a
pixel and a few pixels around edges. The second stage compares the views at the disparity found, and at the nearest and
farthest one of the neighbourhood: across an edge, the right answer is one of these. A refinement like that of `Fast`
decides between them. Then it looks at its answer once more in the same way. No volume is searched at the full width,
so twice the width costs a constant, whatever the range.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.errors import InvalidArgument
from endosdk.training.networks.base import Coarse, Prediction, StereoNetwork, check_max_disparity
from endosdk.training.networks.blocks import (
    ConvNorm,
    ResidualPair,
    fold_batch_norm,
    fold_colour_scaling,
    scaled_colours,
)
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.fast import (
    CELL,
    CLUES,
    DISPARITY_HINT,
    EVIDENCE,
    FINE,
    HINTS,
    LARGE,
    ROUGH_SLOPE,
    SMALL,
    START,
    STRIDE,
    WIDE_UNIT,
    Fast,
    Refinement,
    Shape,
    clues_of,
    log_largest,
    surface_hints,
    surfaces_around,
    unshuffled,
)
from endosdk.training.networks.fast_export import ByteRows, CorrectionApart, over_byte_rows
from endosdk.training.networks.photometric import brightness, moments, step

FIRST = "first."  # prefix of the names of the first stage's weights
SEEN, WHOLE = 3, 4  # the first stage sees so many pixels where the frame has so many, along each axis
RANGE_STEP = 64  # px; SEEN / WHOLE of it holds whole pairs of wide planes


class Look(NamedTuple):
    """What the views say at a disparity, on the coarse grid."""

    hints: Tensor  # [N, HINTS, h, w]
    steps: Tensor  # [N, FINE^2 + 2, h, w], px: what the pictures ask for, the nearest and the farthest surface around
    spread: Tensor  # [N, 2, h, w], as `photometric.Step`


class Cascade(StereoNetwork):
    """`Fast` at 3/4 of the width, two comparisons at the frame's own with a refinement at 1/4 each, answer at 1/2."""

    name = "cascade"
    input_multiple = WHOLE * Fast.input_multiple
    coarse_stride = CELL
    output_stride = STRIDE
    inference_width = 960
    default_crop = (256, 512)

    def __init__(
        self, max_disparity: int = 256, *, dense_disparity: int | None = None, mode_reach: int | None = None
    ) -> None:
        """Build with random weights; ``max_disparity`` and ``dense_disparity`` in input px, multiples of 64.

        The settings are those of `Fast`, which gets 3/4 of them. The first stage does not learn: it is trained alone,
        as `Fast`, and taken over (`adapted`).
        """
        super().__init__()
        self.hint_unit = 1.0  # cells; of the disparity that the refinement is given
        self.max_disparity = check_max_disparity(max_disparity, RANGE_STEP)
        if dense_disparity is not None and (dense_disparity % RANGE_STEP or not 0 < dense_disparity <= max_disparity):
            # Here and not by `Fast`, which would name the numbers that it was given.
            rule = f"must be a multiple of {RANGE_STEP} of at most max_disparity {max_disparity}"
            raise InvalidArgument("dense_disparity", rule, dense_disparity)
        self.first = Fast(
            max_disparity * SEEN // WHOLE,
            dense_disparity=None if dense_disparity is None else dense_disparity * SEEN // WHOLE,
            mode_reach=mode_reach,
        )
        shape = Shape()
        self.pixels = Colours()
        self.stem = ConvNorm(3, shape.stem, kernel=CELL, stride=CELL, padding=(0, 0), slope=ROUGH_SLOPE)
        self.features = nn.Sequential(*(ResidualPair(shape.stem, ROUGH_SLOPE) for _ in range(shape.blocks)))
        self.earlier = Refinement(shape, HINTS, START)  # whose answer the refinement looks at anew
        self.refinement = Refinement(shape, HINTS, START)
        self.refine_margin = shape.refine_margin(self.input_multiple)
        self.confidence = ConfidenceHead(channels=EVIDENCE + 1 + 2 + 3, clues=CLUES)

    @property
    def max_candidate_disparity(self) -> int:
        """The largest whole disparity that the planes of the first stage reach, input px."""
        return self.first.max_candidate_disparity * WHOLE // SEEN

    def adapted(self, weights: dict[str, Tensor], max_disparity: int, dense_disparity: int | None) -> dict[str, Tensor]:
        """Return weights of a `Cascade`, or those of a `Fast` with a second stage as it is now."""
        if any(name.startswith(FIRST) for name in weights):
            return weights
        own = {name: value for name, value in self.state_dict().items() if not name.startswith(FIRST)}
        first = self.first.adapted(weights, max_disparity, dense_disparity)
        return own | {FIRST + name: value for name, value in first.items()}

    def train(self, mode: bool = True) -> Cascade:
        """Set the second stage to train; the first keeps its statistics."""
        super().train(mode)
        self.first.eval()
        return self

    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        """Let the first stage answer on smaller views, answer that anew, and compare the views at that answer."""
        pairs, _, height, width = left.shape
        views = torch.cat([left, right])
        values, bright = self.pixels(left, views)
        cells = height // CELL, width // CELL
        with torch.no_grad():
            small = resized(views.to(torch.float32), (height * SEEN // WHOLE, width * SEEN // WHOLE))
            found = self.first(small[:pairs], small[pairs:])
            disparity = resized(found.disparities[-1].to(torch.float32), cells) * (WHOLE / SEEN)
            doubt = self.first.log_scale(found)
        evidence = F.interpolate(torch.cat([found.evidence, doubt], dim=1), cells, mode="nearest")
        context = self.features(self.stem(values))
        seen = self._look(bright[:pairs], bright[pairs:], disparity)
        answer, _ = self._choose(self.earlier(context, seen.hints), disparity, seen.steps)
        before, disparity = disparity, F.avg_pool2d(answer, FINE)
        seen = self._look(bright[:pairs], bright[pairs:], disparity.detach())
        evidence = torch.cat([evidence, seen.spread, log_largest(disparity - before)], dim=1)
        return Coarse(disparity, evidence, context, seen.hints, seen.steps)

    def refine(self, coarse: Coarse) -> Prediction:
        """Choose between the surface found, the nearest and the farthest around, and add what the pictures ask for."""
        assert coarse.hints is not None and coarse.step is not None
        answer, correction = self._choose(self.refinement(coarse.context, coarse.hints), coarse.disparity, coarse.step)
        rough = self.on_answer_grid(coarse.disparity)
        # On the coarse grid, like all other evidence.
        doubts = [log_largest(F.max_pool2d(change.abs(), FINE)) for change in (correction, answer - rough)]
        evidence = torch.cat([coarse.evidence, *doubts], dim=1)
        return Prediction([rough, answer], evidence, clues=clues_of(coarse.hints, coarse.disparity))

    def _look(self, left: Tensor, right: Tensor, disparity: Tensor) -> Look:
        """Compare the brightness of both views at a disparity [N, 1, h, w], px, and at its neighbours'."""
        compared = moments(left, right, disparity, STRIDE)
        cells = F.avg_pool2d(compared, FINE)
        fine, small, large = step(compared, SMALL), step(cells, SMALL), step(cells, LARGE)
        shuffled = unshuffled(torch.cat(fine, dim=1), FINE)
        hints = [shuffled, small.step, small.texture, large.step, disparity / (CELL * self.hint_unit)]
        surfaces = surfaces_around(disparity)
        for other in surfaces:
            hints += surface_hints(left, right, other, disparity)
        steps = torch.cat([shuffled[:, : FINE**2], *surfaces], dim=1)
        return Look(torch.cat(hints, dim=1), steps, small.spread)

    def _choose(self, outputs: tuple[Tensor, ...], disparity: Tensor, steps: Tensor) -> tuple[Tensor, Tensor]:
        """Return the answer, and the part of it that is neither a surface nor a step, on the grid of the answer."""
        step_wanted, near, far = torch.split(steps, [FINE**2, 1, 1], dim=1)
        correction, belief, to_near, to_far = (F.pixel_shuffle(part, FINE) for part in outputs)
        rough = self.on_answer_grid(disparity)
        near, far = (F.interpolate(part, scale_factor=float(FINE), mode="nearest") for part in (near, far))
        change = correction + torch.sigmoid(belief) * F.pixel_shuffle(step_wanted, FINE)
        change = change + torch.sigmoid(to_near) * (near - rough) + torch.sigmoid(to_far) * (far - rough)
        return torch.relu(rough + change), correction

    def export_form(self) -> StereoNetwork:
        """Return a copy in evaluation mode that can run in 8-bit integers from the first layers on."""
        form = copy.deepcopy(self).eval()
        form.first = self.first.export_form()  # type: ignore[assignment]
        for part in (form.stem, form.features, form.earlier, form.refinement):
            fold_batch_norm(part)
        stem = form.stem
        fold_colour_scaling(stem.conv)
        form.pixels = ByteColours()  # type: ignore[assignment]
        form.stem = nn.Sequential(over_byte_rows(stem.conv), stem.activation)  # type: ignore[assignment]
        form.reads_bytes = True
        # As in `Fast`: the disparity in a unit in which it is about as large as the other hints.
        form.hint_unit = WIDE_UNIT
        with torch.no_grad():
            for refinement in (form.earlier, form.refinement):
                refinement.hints.weight[:, DISPARITY_HINT] *= WIDE_UNIT
        form.earlier = CorrectionApart(form.earlier, FINE**2)  # type: ignore[assignment]
        form.refinement = CorrectionApart(form.refinement, FINE**2)  # type: ignore[assignment]
        return form


def resized(values: Tensor, size: tuple[int, int]) -> Tensor:
    """Bring maps or views to a smaller size of whole rows and columns."""
    return F.interpolate(values, size, mode="bilinear", align_corners=False)


class Colours(nn.Module):
    """What the second stage sees of the views."""

    def forward(self, left: Tensor, views: Tensor) -> tuple[Tensor, Tensor]:
        """Map the left view [N, 3, H, W] and both [2N, 3, H, W], 0..255, to scaled colours and brightness of both."""
        return scaled_colours(left), brightness(views)


class ByteColours(nn.Module):
    """The same for bytes, in the layout of `ByteRows`."""

    def forward(self, left: Tensor, views: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 views to float rows of the left one and the brightness of both."""
        rows, _ = ByteRows(CELL)(left)
        return rows, brightness(views.to(torch.float32))
