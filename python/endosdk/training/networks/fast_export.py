"""`Fast` in the form in which it is deployed: the same function in layouts and units that suit runtimes.

Runtimes compute 8-bit convolutions with the channels last, which they gather in runs of a few bytes where channels are
few, and those with 32 channels of output in less time for a multiplication than those with 16. So the stem reads four
pixels as one of twelve channels, and the volume keeps two neighbouring planes together; the weights that these do not
share are zeros: a third more multiplications, in less time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.training.networks.blocks import ConvNorm, fold_colour_scaling
from endosdk.training.networks.clues import WIDE_UNIT
from endosdk.training.networks.comparison import DISPARITY_HINT, FINE
from endosdk.training.networks.confidence_export import DeployedConfidence
from endosdk.training.networks.cost_volume import Planes, SoftArgmin, soft_argmin_of_planes
from endosdk.training.networks.functions import as_function
from endosdk.training.networks.photometric import brightness

if TYPE_CHECKING:
    from endosdk.training.networks.cascade import Cascade
    from endosdk.training.networks.fast import Fast, PlaneLayers, Refinement

PAIR = 2  # planes that are computed together


class ReadViews(nn.Module):
    """The bytes of the views for the stem, a row of ``cell`` pixels as one, and the brightness of the views."""

    def __init__(self, cell: int) -> None:
        super().__init__()
        self.cell = cell

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 [N, 3, H, W] to rows [2N, H, W/cell, 3 cell] and brightness [2N, 1, H/2, W], left views first."""
        views = torch.cat([left, right])
        return rows_of(views, self.cell), brightness(views.to(torch.float32))


class ViewRows(nn.Module):
    """What a module like `ReadViews` gives, in the layout and the type of convolutions."""

    def __init__(self, read: nn.Module) -> None:
        super().__init__()
        self.read = as_function(read)

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 views [N, 3, H, W] to float rows [2N, 3 cell, H, W/cell], 0..255, and brightness."""
        rows, bright = self.read(left, right)
        return for_layers(rows), bright


def for_layers(rows: Tensor) -> Tensor:
    """Bring rows [N, H, w, C] to the layout and the type of convolutions, float [N, C, H, w]."""
    return rows.permute(0, 3, 1, 2).to(torch.float32)


def channels_last(values: Tensor) -> Tensor:
    """Bring maps [N, C, h, w] to [N, h, w, C]."""
    return values.permute(0, 2, 3, 1)


def rows_of(views: Tensor, cell: int) -> Tensor:
    """Lay views [N, 3, H, W] out as rows [N, H, W/cell, 3 cell]: colour by colour, ``cell`` pixels as one."""
    count, colours, height, width = views.shape
    return channels_last(views).reshape(count, height, width // cell, colours * cell)


def stem_over_rows(stem: ConvNorm) -> nn.Sequential:
    """Make the stem that reads `ViewRows` of bytes: the scaling of colours moves into its weights."""
    fold_colour_scaling(stem.conv)
    return nn.Sequential(over_rows(stem.conv), stem.activation)


def deploy_comparisons(form: Fast | Cascade, refinements: Iterable[str], functions: Iterable[str]) -> None:
    """Bring what follows the coarse answer into the form of a file.

    Args:
        form: a copy in evaluation mode, without batch norm; changed in place.
        refinements: names of its parts that read the hints of its ``compare``.
        functions: names of its parts that become functions of the file.

    """
    # All hints have one 8-bit scale, of which the disparity would leave the others little.
    form.compare.unit *= WIDE_UNIT
    for name in refinements:
        refinement = getattr(form, name)
        with torch.no_grad():
            refinement.hints.weight[:, DISPARITY_HINT] *= WIDE_UNIT
        setattr(form, name, CorrectionApart(refinement, FINE**2))
    form.confidence = DeployedConfidence(form.confidence)  # type: ignore[assignment]
    for name in functions:
        setattr(form, name, as_function(getattr(form, name)))


def over_rows(conv: nn.Module) -> nn.Conv2d:
    """Make the convolution over `ViewRows` that equals a 2-D one whose stride is its kernel."""
    assert isinstance(conv, nn.Conv2d) and conv.bias is not None
    high, wide = conv.kernel_size
    flat = nn.Conv2d(conv.in_channels * wide, conv.out_channels, (high, 1), stride=(high, 1))
    with torch.no_grad():
        flat.weight.copy_(conv.weight.permute(0, 3, 1, 2).flatten(1, 2).unsqueeze(3))
        flat.bias.copy_(conv.bias)  # type: ignore[union-attr]
    return flat


class PairedVolume(nn.Module):
    """Differences of matching features, two planes together: from left and right maps [N, C, h, w].

    ``match`` is the convolution of stride 2 whose results are compared: even shifts are whole cells of it, odd ones are
    its results one input column further left.
    """

    def __init__(self, match: nn.Conv2d, planes: Planes) -> None:
        super().__init__()
        self.differences = as_function(VolumeOfPairs(planes))
        outputs, inputs = match.weight.shape[:2]
        assert match.bias is not None
        self.left = nn.Conv2d(inputs, PAIR * outputs, 3, stride=2, padding=1)
        self.right = nn.Conv2d(inputs, PAIR * outputs, (3, 4), stride=2)
        with torch.no_grad():
            self.left.weight.copy_(match.weight.repeat(PAIR, 1, 1, 1))
            self.left.bias.copy_(match.bias.repeat(PAIR))  # type: ignore[union-attr]
            # Negative, because runtimes have an addition for 8-bit integers and no difference.
            even, odd = F.pad(match.weight, (1, 0)), F.pad(match.weight, (0, 1))
            self.right.weight.copy_(-torch.cat([even, odd]))
            self.right.bias.copy_(-match.bias.repeat(PAIR))  # type: ignore[union-attr]

    def forward(self, left: Tensor, right: Tensor) -> Tensor:
        """Give the volume [N, planes/2, h/2, w/2, 2 channels]: in the layout of 8-bit convolutions."""
        own = channels_last(self.left(left))
        other = channels_last(self.right(F.pad(right, (2, 1, 1, 1))))
        return self.differences(own, other)[0]  # type: ignore[no-any-return]


class VolumeOfPairs(nn.Module):
    """Differences of the features of both views for every shift, two planes together."""

    def __init__(self, planes: Planes) -> None:
        super().__init__()
        self.planes = planes

    @property
    def attributes(self) -> dict[str, int]:
        """What the function of a model file says of itself."""
        return {"dense": self.planes.dense, "sparse": self.planes.sparse}

    def forward(self, own: Tensor, other: Tensor) -> tuple[Tensor]:
        """Map features [N, h, w, 2 C] of both views, those of the right one negative, to [N, planes/2, h, w, 2 C]."""
        dense = self.planes.dense // PAIR
        room = self.planes.shifts[-1] // PAIR
        # The border stands in for what lies beyond it: copies stay 8-bit when the network is quantised.
        padded = torch.cat([other[:, :, :1]] * room + [other], dim=2)
        shifted = [padded[:, :, room - shift : (-shift or None)] for shift in range(dense)]
        if self.planes.sparse:
            even = padded[..., : padded.shape[3] // PAIR]  # every second shift is an even one
            single = [even[:, :, room - shift : -shift] for shift in range(dense, room + 1)]
            shifted += [torch.cat(single[i : i + PAIR], dim=3) for i in range(0, len(single), PAIR)]
        return (torch.relu(own.unsqueeze(1) + torch.stack(shifted, dim=1)),)


class PairedLayers(nn.Module):
    """The layers over a volume, where planes lie in pairs: each convolution is over a pair and its two neighbours."""

    def __init__(self, layers: PlaneLayers, planes: Planes) -> None:
        super().__init__()
        self.planes = planes
        self.around = as_function(PlanesAround(len(planes) // PAIR))
        self.layers = nn.ModuleList(_over_pairs(layer.conv) for layer in layers.layers)  # type: ignore[arg-type]
        self.per_cell = layers.cost.out_channels
        # Costs matter by their differences from plane to plane, in which the bias cancels.
        weight = layers.cost.weight.detach()[:, :, 0, 0].t()
        padded = torch.zeros(PAIR, 1, PAIR, *weight.shape)
        for place in range(PAIR):
            padded[place, 0, place] = weight
        self.register_buffer("costs", padded.flatten(2, 3))
        # First the even planes, then the odd ones: so nothing has to be moved.
        order = [plane for place in range(PAIR) for plane in range(place, len(planes), PAIR)]
        self.answer = as_function(AnswerOfPlanes(planes, order, layers.mode_reach))
        self.surroundings = layers.surroundings
        outputs = torch.arange(len(planes) * self.per_cell).view(len(planes), self.per_cell)[order].flatten()
        for name, values in zip(("corrections", "offsets"), self.surroundings.product(outputs), strict=True):
            self.register_buffer(name, values)

    def forward(self, volume: Tensor, view: Tensor) -> tuple[SoftArgmin, None]:
        """Map the volume [N, D/2, h, w, 2 C] to its answer, in cells, on a grid of twice the size; no cost is kept."""
        count, pairs, height, width, both = volume.shape
        result = volume.flatten(0, 1)
        for layer in self.layers:
            (around,) = self.around(result)
            result = channels_last(torch.relu(layer(around.permute(0, 3, 1, 2))))
        cells = result.reshape(count, 1, pairs, height * width, both)
        cost = cells @ self.get_buffer("costs")
        joined = torch.unflatten(result, 0, (count, pairs)).permute(0, 1, 4, 2, 3).flatten(1, 2)
        seen = self.surroundings.seen(joined, view)
        seen = seen.permute(0, 2, 3, 1).reshape(count, height * width, -1) @ self.get_buffer("corrections")
        seen = (seen + self.get_buffer("offsets")).reshape(count, height, width, -1)
        return SoftArgmin(*self.answer(cost, seen)), None


class PlanesAround(nn.Module):
    """Pairs of planes with the plane before and the one after.

    The first and last plane stand in for the neighbours they lack: copies stay 8-bit, padding would not.
    """

    def __init__(self, pairs: int) -> None:
        super().__init__()
        self.pairs = pairs

    @property
    def attributes(self) -> dict[str, int]:
        """What the function of a model file says of itself."""
        return {"pairs": self.pairs}

    def forward(self, planes: Tensor) -> tuple[Tensor]:
        """Map pairs of planes [N D/2, h, w, 2 C] to [N D/2, h, w, 4 C]."""
        pairs = torch.unflatten(planes, 0, (-1, self.pairs))
        channels = planes.shape[3] // PAIR
        first, second = pairs[..., :channels], pairs[..., channels:]
        before = torch.cat([first[:, :1], second[:, :-1]], dim=1)
        after = torch.cat([first[:, 1:], second[:, -1:]], dim=1)
        return (torch.cat([before, pairs, after], dim=4).flatten(0, 1),)


class AnswerOfPlanes(nn.Module):
    """The soft-argmin of costs as `PairedLayers` has them."""

    def __init__(self, planes: Planes, order: Sequence[int], mode_reach: int | None) -> None:
        super().__init__()
        self.planes, self.order, self.mode_reach = planes, order, mode_reach

    @property
    def attributes(self) -> dict[str, int]:
        """What the function of a model file says of itself; a reach of 0: the mean of all planes."""
        return {"dense": self.planes.dense, "sparse": self.planes.sparse, "reach": self.mode_reach or 0}

    def forward(self, cost: Tensor, correction: Tensor) -> SoftArgmin:
        """Map costs [N, 2, D/2, h w, 4] and their correction [N, h, w, 4 D] to the answer, on a grid of twice the size.

        Planes come in the order of ``order``; the four cells of the larger grid are channels, as `pixel_shuffle` takes
        them.
        """
        count, height, width, _ = correction.shape
        per_cell = cost.shape[4]
        moved = correction.reshape(count, height * width, -1, per_cell).permute(0, 2, 1, 3)
        both = (cost.flatten(1, 2) + moved).flatten(2)
        found = soft_argmin_of_planes(both, self.planes, self.order, self.mode_reach)
        maps = (value.reshape(count, height, width, per_cell).permute(0, 3, 1, 2) for value in found)
        return SoftArgmin(*(F.pixel_shuffle(values, PAIR) for values in maps))


class CorrectionApart(nn.Module):
    """A refinement whose first output, the correction of ``channels`` channels, has a layer of its own.

    The correction counts in hundredths of a pixel, the others are logits of up to twenty: with one 8-bit scale for all,
    the correction would come in steps of an eighth of a pixel. Alone it is too thin for 8 bits, and stays in floats.
    """

    def __init__(self, refinement: Refinement, channels: int) -> None:
        super().__init__()
        self.refinement = refinement
        last = refinement.last
        self.thin = _outputs_of(last, slice(0, channels))
        self.correction = as_function(ThinConvolution())
        self.others = _outputs_of(last, slice(channels, last.out_channels))

    def forward(self, view: Tensor, hints: Tensor) -> tuple[Tensor, Tensor]:
        """Map what the refinement reads to what it gives."""
        seen = self.refinement.seen(view, hints)
        return self.correction(seen, self.thin.weight, self.thin.bias)[0], self.others(seen)


class ThinConvolution(nn.Module):
    """A 3 x 3 convolution with few outputs, which comes with its weights."""

    def forward(self, values: Tensor, weight: Tensor, bias: Tensor) -> tuple[Tensor]:
        """Map values [N, C, h, w] to [N, O, h, w]."""
        return (F.conv2d(values, weight, bias, padding=1),)


def _outputs_of(conv: nn.Conv2d, outputs: slice) -> nn.Conv2d:
    """Make the 3 x 3 convolution that gives these outputs alone."""
    assert conv.bias is not None
    part = nn.Conv2d(conv.in_channels, outputs.stop - outputs.start, 3, padding=1)
    with torch.no_grad():
        part.weight.copy_(conv.weight[outputs])
        part.bias.copy_(conv.bias[outputs])  # type: ignore[union-attr]
    return part


def _over_pairs(conv: nn.Conv2d) -> nn.Conv2d:
    """Turn a convolution over [previous, this, next] plane into one over [previous, both of a pair, next]."""
    assert conv.bias is not None
    outputs, inputs = conv.out_channels, conv.in_channels // 3
    paired = nn.Conv2d((PAIR + 2) * inputs, PAIR * outputs, 3, padding=1)
    with torch.no_grad():
        paired.weight.zero_()
        for place in range(PAIR):
            own = slice(place * outputs, (place + 1) * outputs)
            paired.weight[own, place * inputs : (place + 3) * inputs] = conv.weight
        paired.bias.copy_(conv.bias.repeat(PAIR))  # type: ignore[union-attr]
    return paired
