"""`Fast` on a smaller frame, then two looks at the frame's own width.

The first stage has the range and the surroundings at half of the cost. What it leaves open are fractions of a
pixel and a few pixels around edges. The second stage compares the views at the disparity found, and at the nearest and
farthest one of the neighbourhood: across an edge, the right answer is one of these. A refinement like that of `Fast`
decides between them. Then it looks at its answer once more in the same way. No volume is searched at the full width,
so twice the width costs a constant, whatever the range.
"""

from __future__ import annotations

import copy

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.errors import InvalidArgument
from endosdk.training.networks.base import Coarse, Prediction, StereoNetwork, check_max_disparity
from endosdk.training.networks.blocks import (
    ConvNorm,
    ResidualPair,
    fold_batch_norm,
    scaled_colours,
)
from endosdk.training.networks.clues import CLUES, DOUBTS, CluesOfAnswer, log_largest
from endosdk.training.networks.comparison import (
    CELL,
    FINE,
    HINTS,
    STRIDE,
    ChooseSurface,
    CompareViews,
)
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.fast import EVIDENCE, ROUGH_SLOPE, START, Fast, Refinement, Shape
from endosdk.training.networks.fast_export import (
    ReadViews,
    ViewRows,
    deploy_comparisons,
    for_layers,
    rows_of,
    stem_over_rows,
)
from endosdk.training.networks.photometric import brightness

FIRST = "first."  # prefix of the names of the first stage's weights
SEEN, WHOLE = 3, 4  # the first stage sees so many pixels where the frame has so many, along each axis
RANGE_STEP = 64  # px; SEEN / WHOLE of it holds whole pairs of wide planes


class Cascade(StereoNetwork):
    """`Fast` at 3/4 of the width, two comparisons at the frame's own with a refinement at 1/4 each, answer at 1/2."""

    name = "cascade"
    input_multiple = WHOLE * Fast.input_multiple
    coarse_stride = CELL
    output_stride = STRIDE
    inference_width = 960
    default_crop = (256, 512)
    given_parts = (FIRST,)

    def __init__(
        self, max_disparity: int = 256, *, dense_disparity: int | None = None, mode_reach: int | None = None
    ) -> None:
        """Build with random weights; ``max_disparity`` and ``dense_disparity`` in input px, multiples of 64.

        The settings are those of `Fast`, which gets 3/4 of them. The first stage does not learn: it is trained alone,
        as `Fast`, and taken over (`adapted`).
        """
        super().__init__()
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
        self.smaller = Smaller(self.first.pixels)
        self.stem = ConvNorm(3, shape.stem, kernel=CELL, stride=CELL, padding=(0, 0), slope=ROUGH_SLOPE)
        self.features = nn.Sequential(*(ResidualPair(shape.stem, ROUGH_SLOPE) for _ in range(shape.blocks)))
        self.compare = CompareViews()
        self.choose = ChooseSurface()
        self.look = CluesOfAnswer()
        self.earlier = Refinement(shape, HINTS, START)  # whose answer the refinement looks at anew
        self.refinement = Refinement(shape, HINTS, START)
        self.refine_margin = shape.refine_margin(self.input_multiple)
        self.confidence = ConfidenceHead(channels=EVIDENCE + 1 + 3 + DOUBTS, clues=CLUES)

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
        cells = left.shape[2] // CELL, left.shape[3] // CELL
        values, bright = self.pixels(left, right)
        with torch.no_grad():
            found = self.first.refine(self.first.match(*self.smaller(left, right)))
            disparity = resized(found.disparities[-1].to(torch.float32), cells) * (WHOLE / SEEN)
            doubt = self.first.log_scale(found)
        evidence = F.interpolate(torch.cat([found.evidence, doubt], dim=1), cells, mode="nearest")
        context = self.features(self.stem(values))
        hints, steps, _ = self.compare(bright, disparity)
        answer, _, _ = self.choose(*self.earlier(context, hints), disparity, steps)
        before, disparity = disparity, F.avg_pool2d(answer, FINE)
        hints, steps, spread = self.compare(bright, disparity.detach())
        evidence = torch.cat([evidence, spread, log_largest(disparity - before)], dim=1)
        return Coarse(disparity, evidence, context, hints, steps)

    def refine(self, coarse: Coarse) -> Prediction:
        """Choose between the surface found, the nearest and the farthest around, and add what the pictures ask for."""
        assert coarse.hints is not None and coarse.step is not None
        correction, others = self.refinement(coarse.context, coarse.hints)
        answer, _, rough = self.choose(correction, others, coarse.disparity, coarse.step)
        doubts, clues = self.look(coarse.hints, coarse.disparity, correction, answer - rough)
        return Prediction([rough, answer], torch.cat([coarse.evidence, doubts], dim=1), clues=clues)

    def export_form(self) -> StereoNetwork:
        """Return a copy in evaluation mode that can run in 8-bit integers from the first layers on."""
        form = copy.deepcopy(self).eval()
        form.first = self.first.export_form()  # type: ignore[assignment]
        for part in (form.stem, form.features, form.earlier, form.refinement):
            fold_batch_norm(part)
        form.pixels = LeftRows(ReadViews(CELL))  # type: ignore[assignment]
        form.smaller = ViewRows(ReadSmaller(CELL))  # type: ignore[assignment]
        form.stem = stem_over_rows(form.stem)  # type: ignore[assignment]
        form.reads_bytes = True
        deploy_comparisons(form, ["earlier", "refinement"], ["compare", "choose", "look"])
        return form


def resized(values: Tensor, size: tuple[int, int]) -> Tensor:
    """Bring maps or views to a smaller size of whole rows and columns."""
    return F.interpolate(values, size, mode="bilinear", align_corners=False)


class Colours(nn.Module):
    """What the second stage sees of the views."""

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map views [N, 3, H, W], 0..255, to scaled colours of the left one and the brightness of both."""
        return scaled_colours(left), brightness(torch.cat([left, right]))


class Smaller(nn.Module):
    """What the first stage sees of the views."""

    def __init__(self, pixels: nn.Module) -> None:
        super().__init__()
        self.pixels = pixels

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map views [N, 3, H, W], 0..255, to what `Pixels` gives of smaller ones."""
        seen: tuple[Tensor, Tensor] = self.pixels(*smaller_views(torch.cat([left, right])).chunk(2))
        return seen


class LeftRows(ViewRows):
    """`Colours` of bytes, as rows."""

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 views [N, 3, H, W] to rows of the left one and the brightness of both."""
        rows, bright = self.read(left, right)
        return for_layers(rows[: left.shape[0]]), bright


class ReadSmaller(nn.Module):
    """`Smaller` of bytes, as rows."""

    def __init__(self, cell: int) -> None:
        super().__init__()
        self.cell = cell

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 views [N, 3, H, W] to float rows of smaller ones, [2N, h, w/cell, 3 cell], and brightness."""
        views = smaller_views(torch.cat([left, right]).to(torch.float32))
        return rows_of(views, self.cell), brightness(views)


def smaller_views(views: Tensor) -> Tensor:
    """Bring views [N, 3, H, W] to the size that the first stage sees."""
    height, width = views.shape[2:]
    return resized(views, (height * SEEN // WHOLE, width * SEEN // WHOLE))
