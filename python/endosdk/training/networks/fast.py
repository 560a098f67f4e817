"""A small network for processors without a graphics card.

It follows the operator timings of ONNX Runtime on CPUs rather than a count of multiplications: it sees frames 480 px
wide, so that reading them costs a quarter; its wide layers are plain 2-D convolutions, which run in 8-bit integers; and
the volume is as thin as matching allows. Differences of features are taken at 1/8 of the size but for every cell of
1/4: an odd shift is an even one of features computed one cell further left, so nothing the size of a volume at 1/4 ever
exists. What planes of four pixels leave open, the pictures themselves decide (`photometric`); the refinement says where
to believe them.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

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
from endosdk.training.networks.clues import CLUES, DOUBTS, CluesOfAnswer, MatchEvidence
from endosdk.training.networks.comparison import (
    CELL,
    FINE,
    HINTS,
    STRIDE,
    ChooseSurface,
    CompareViews,
)
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.cost_volume import Planes, SoftArgmin, soft_argmin
from endosdk.training.networks.fast_export import (
    PairedLayers,
    PairedVolume,
    ReadViews,
    ViewRows,
    deploy_comparisons,
    stem_over_rows,
)
from endosdk.training.networks.photometric import brightness
from endosdk.training.networks.surroundings import Surroundings

HALVED = 2  # cells of the matching grid, which are CELL px and as far apart as disparity planes, per cell of the volume
# The refinement begins with these outputs: its correction, its belief in the step, and its gates to the nearest and the
# farthest surface around. So it adds no correction, believes the pictures, and hardly opens the gates.
START = 0.0, 1.0, -3.0, -3.0
EVIDENCE = 4 + DOUBTS  # channels of evidence
ROUGH_SLOPE = 0.0  # plain rectifiers: runtimes fold them into 8-bit convolutions for nothing


@dataclass(frozen=True)
class Shape:
    """How wide and deep the parts are; channels in multiples of 16 fill the vector units."""

    stem: int = 32  # channels at 1/4
    blocks: int = 2  # residual pairs at 1/4, for both views
    volume: int = 16  # channels of the volume
    layers: int = 2  # convolutions over the volume
    surroundings: int = 64  # channels of what corrects the volume by its surroundings
    refine: int = 32  # channels of the refinement
    refine_layers: int = 6  # between its first and last convolution
    wide_layers: int = 3  # after them, twice as far apart

    def refine_margin(self, multiple: int) -> int:
        """Return how far the refinement looks, in input px, up to a multiple."""
        reach = CELL * (1 + 2 * self.refine_layers + 4 * self.wide_layers + 1)
        return -(-reach // multiple) * multiple


class Fast(StereoNetwork):
    """Patch stem, difference volume at 1/8 with planes of 1/4, refinement at 1/4, answer at 1/2."""

    name = "fast"
    input_multiple = CELL * HALVED
    coarse_stride = CELL
    output_stride = STRIDE
    plane_step = CELL
    inference_width = 480
    default_crop = (256, 384)  # it fits into frames of 4:3, which the network sees 360 px high

    def __init__(
        self,
        max_disparity: int = 48,
        shape: Shape | None = None,
        *,
        dense_disparity: int | None = None,
        mode_reach: int | None = None,
    ) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 8.

        From ``dense_disparity`` on, a multiple of 8, planes are 8 px apart instead of 4; there are an even number of
        them, because the deployed form computes two at a time. ``mode_reach`` as in `soft_argmin`.
        """
        super().__init__()
        shape = shape or Shape()
        self.max_disparity = check_max_disparity(max_disparity, CELL * HALVED)
        self.planes = candidate_planes(self.max_disparity, dense_disparity)
        self.candidates = tuple(CELL * shift for shift in self.planes.shifts)
        self.pixels = Pixels()
        # Patches that do not overlap need no padding, so the scaling of colours folds into the first weights.
        self.stem = ConvNorm(3, shape.stem, kernel=CELL, stride=CELL, padding=(0, 0), slope=ROUGH_SLOPE)
        self.features = nn.Sequential(*(ResidualPair(shape.stem, ROUGH_SLOPE) for _ in range(shape.blocks)))
        self.volume = DifferenceVolume(shape.stem, shape.volume, self.planes)
        self.aggregation = PlaneLayers(shape, self.planes, mode_reach)
        self.judge = MatchEvidence(CELL)
        self.compare = CompareViews()
        self.refinement = Refinement(shape, HINTS, START)
        self.choose = ChooseSurface()
        self.look = CluesOfAnswer()
        self.refine_margin = shape.refine_margin(self.input_multiple)
        self.confidence = ConfidenceHead(channels=EVIDENCE, clues=CLUES)

    @property
    def max_candidate_disparity(self) -> int:
        """The largest disparity there is a plane for, input px."""
        return self.candidates[-1]

    def adapted(self, weights: dict[str, Tensor], max_disparity: int, dense_disparity: int | None) -> dict[str, Tensor]:
        """Return the weights of a `Fast` with planes of its own as this one can take them.

        Only the surroundings know the planes apart: each plane takes the weights of the nearest of the other network.
        """
        part = "aggregation.surroundings."
        planes = candidate_planes(max_disparity, dense_disparity)
        if planes == self.planes or not any(name.startswith(part) for name in weights):
            # Weights of another release may have no surroundings: what loads them names what is missing.
            return weights
        return weights | {
            part + name: value
            for name, value in self.aggregation.surroundings.with_planes(
                {name.removeprefix(part): value for name, value in weights.items() if name.startswith(part)},
                planes.shifts,
                self.planes.shifts,
            ).items()
        }

    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        """Match at 1/8, give the answer at 1/4, and compare the pictures there."""
        return self.match(*self.pixels(left, right))

    def match(self, values: Tensor, bright: Tensor) -> Coarse:
        """Do the same from what `Pixels` gives, left views first."""
        views = self.features(self.stem(values))
        pairs = bright.shape[0] // 2
        found, cost = self.aggregation(self.volume(views[:pairs], views[pairs:]), views[:pairs])
        disparity = found.disparity * CELL
        hints, steps, spread = self.compare(bright, disparity)
        evidence = torch.cat([*self.judge(*found), spread], dim=1)
        return Coarse(disparity, evidence, views[:pairs], hints, steps, cost)

    def refine(self, coarse: Coarse) -> Prediction:
        """Take the step that the pictures ask for where it is to be believed, add what edges tell, and rectify."""
        assert coarse.hints is not None and coarse.step is not None
        correction, others = self.refinement(coarse.context, coarse.hints)
        answer, change, rough = self.choose(correction, others, coarse.disparity, coarse.step)
        doubts, clues = self.look(coarse.hints, coarse.disparity, correction, change)
        return Prediction([rough, answer], torch.cat([coarse.evidence, doubts], dim=1), clues=clues)

    def export_form(self) -> StereoNetwork:
        """Return a copy in evaluation mode that can run in 8-bit integers from the first layer on.

        The scaling of colours moves into the first weights, so that the network reads the bytes of the picture; what
        follows takes the layouts of `fast_export`.
        """
        form = copy.deepcopy(self).eval()
        fold_batch_norm(form)
        form.pixels = ViewRows(ReadViews(CELL))  # type: ignore[assignment]
        form.stem = stem_over_rows(form.stem)  # type: ignore[assignment]
        form.volume = PairedVolume(form.volume.match, self.planes)  # type: ignore[assignment]
        form.aggregation = PairedLayers(form.aggregation, self.planes)  # type: ignore[assignment]
        form.reads_bytes = True
        deploy_comparisons(form, ["refinement"], ["judge", "compare", "choose", "look"])
        return form


def candidate_planes(max_disparity: int, dense_disparity: int | None) -> Planes:
    """Return the planes up to ``max_disparity``, 4 px apart up to ``dense_disparity`` and 8 px beyond it."""
    if dense_disparity is None:
        return Planes(max_disparity // CELL)
    step = CELL * HALVED
    if dense_disparity % step or not 0 < dense_disparity <= max_disparity:
        rule = f"must be a multiple of {step} of at most max_disparity {max_disparity}"
        raise InvalidArgument("dense_disparity", rule, dense_disparity)
    if (max_disparity - dense_disparity) % (2 * step):
        rule = f"must lie a multiple of {2 * step} px below max_disparity {max_disparity}"
        raise InvalidArgument("dense_disparity", rule, dense_disparity)
    return Planes(dense_disparity // CELL, (max_disparity - dense_disparity) // step)


class Pixels(nn.Module):
    """What the stem and the comparison see of the views."""

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map views [N, 3, H, W], 0..255, to scaled colours [2N, 3, H, W] and brightness [2N, 1, H/2, W]."""
        views = torch.cat([left, right])
        return scaled_colours(views), brightness(views)


class DifferenceVolume(nn.Module):
    """Differences of matching features for every shift of whole cells, on a grid of half the size."""

    def __init__(self, inputs: int, channels: int, planes: Planes) -> None:
        super().__init__()
        self.planes = planes
        self.match = nn.Conv2d(inputs, channels, 3, stride=HALVED, padding=1)

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Map two feature maps [N, C, h, w] to the volume [N, planes, channels, h/2, w/2]."""
        even = self.match(right)
        # Centred one cell further left: two columns of padding before and none behind.
        odd = F.conv2d(F.pad(right, (2, 0, 1, 1)), self.match.weight, self.match.bias, stride=HALVED)
        own = self.match(left).unsqueeze(1)
        shifts = self.planes.shifts
        room = shifts[-1] // HALVED
        # The border stands in for what lies beyond it: copies stay 8-bit when the network is quantised.
        padded = [torch.cat([view[..., :1]] * room + [view], dim=-1) for view in (even, odd)]
        moved = [(padded[shift % HALVED], shift // HALVED) for shift in shifts]
        shifted = torch.stack([view[..., room - k : (-k or None)] for view, k in moved], dim=1)
        return torch.relu(own - shifted)


class PlaneLayers(nn.Module):
    """3x3x3 convolutions over the volume, written as 2-D ones over each plane and its two neighbours.

    They see little more than one cell. What that leaves open, the `Surroundings` decide.
    """

    def __init__(self, shape: Shape, planes: Planes, mode_reach: int | None) -> None:
        super().__init__()
        self.planes = planes
        self.mode_reach = mode_reach
        channels = shape.volume
        self.layers = nn.ModuleList(ConvNorm(3 * channels, channels, slope=ROUGH_SLOPE) for _ in range(shape.layers))
        self.cost = nn.Conv2d(channels, HALVED**2, 1)
        volume = len(planes) * channels
        self.surroundings = Surroundings(volume, shape.stem, shape.surroundings, len(planes) * HALVED**2)

    def forward(self, volume: Tensor, view: Tensor) -> tuple[SoftArgmin, Tensor]:
        """Map the volume [N, D, C, h, w] to its answer on a grid of twice the size, in cells, and the cost.

        ``view`` are the features of the left view on that larger grid.

        The cost [N, D, 4, h, w] has the four cells of that grid as channels, as `pixel_shuffle` takes them.
        """
        pairs, planes = volume.shape[:2]
        # The first and last plane stand in for the neighbours they lack: copies stay 8-bit, padding would not.
        around = torch.arange(planes).view(-1, 1) + torch.arange(-1, 2)
        around = around.clamp(0, planes - 1).flatten().to(volume.device)
        for layer in self.layers:
            neighbours = torch.unflatten(volume.index_select(1, around), 1, (planes, 3)).flatten(2, 3)
            volume = torch.unflatten(layer(neighbours.flatten(0, 1)), 0, (pairs, planes))
        cost = torch.unflatten(self.cost(volume.flatten(0, 1)), 0, (pairs, planes))
        cost = cost + torch.unflatten(self.surroundings(volume.flatten(1, 2), view), 1, (planes, -1))
        # The sums over planes come before the larger grid, which would be twelve times as much to move.
        found = soft_argmin(cost.permute(0, 2, 3, 4, 1).flatten(0, 1), self.planes, self.mode_reach)
        maps = (F.pixel_shuffle(torch.unflatten(v.squeeze(1), 0, (pairs, -1)), HALVED) for v in found)
        return SoftArgmin(*maps), cost


class Refinement(nn.Module):
    """Convolutions at 1/4 over the left view, the coarse answer and what the comparison of the pictures gave."""

    def __init__(self, shape: Shape, hints: int, start: tuple[float, ...]) -> None:
        """Read so many ``hints``; give one output for each value of ``start``, which is what it is at first."""
        super().__init__()
        self.view = ConvNorm(shape.stem, shape.refine, slope=ROUGH_SLOPE)
        # Apart from the view, because the two differ in range: together they would share one 8-bit scale.
        self.hints = nn.Conv2d(hints, shape.refine, 3, padding=1, bias=False)
        dilations = [2] * shape.refine_layers + [4] * shape.wide_layers
        self.layers = nn.Sequential(
            *(ConvNorm(shape.refine, shape.refine, dilation=d, slope=ROUGH_SLOPE) for d in dilations)
        )
        self.last = nn.Conv2d(shape.refine, len(start) * FINE**2, 3, padding=1)
        # It starts with the same outputs everywhere, so that it cannot spoil a map that is already good.
        nn.init.zeros_(self.last.weight)
        with torch.no_grad():
            self.last.bias.copy_(torch.tensor(start).repeat_interleave(FINE**2))  # type: ignore[union-attr]

    def forward(self, view: Tensor, hints: Tensor) -> tuple[Tensor, Tensor]:
        """Map features and hints [N, C, h, w] to the correction, FINE^2 channels, and to the other outputs."""
        outputs = self.last(self.seen(view, hints))
        correction, others = outputs.tensor_split([FINE**2], dim=1)
        return correction, others

    def seen(self, view: Tensor, hints: Tensor) -> Tensor:
        """Map features and hints to what the outputs are read from, [N, refine, h, w]."""
        out: Tensor = self.layers(self.view(view, added=self.hints(hints)))
        return out
