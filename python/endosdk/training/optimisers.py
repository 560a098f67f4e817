"""The optimisers that a run may use."""

from __future__ import annotations

from collections import defaultdict

import torch
from torch import Tensor, nn
from torch.optim import Optimizer
from torch.optim.adamw import adamw

from endosdk.training.config import TrainConfig

# These are a, b and c of the quintic x (a + b x^2 + c x^4), which brings every singular value of 0..1 near to 1 in five
# rounds.
QUINTIC = (3.4445, -4.7750, 2.0315)
ROUNDS = 5
ADAMW_SIZE = 0.2  # how much AdamW usually moves a weight, as a share of the rate: so both go by the same rate
SMALLEST = 1e-7
MOMENTUM = 0.95
ADAM_MOMENTA = 0.9, 0.999  # of the gradient and of its square
ADAM_STATE = "exp_avg", "exp_avg_sq"


def build_optimiser(network: nn.Module, config: TrainConfig) -> Optimizer:
    """Return the optimiser of the settings over all parameters of the network."""
    if config.optimiser == "rmsprop":
        return torch.optim.RMSprop(network.parameters(), lr=config.rate)
    if config.optimiser == "muon":
        return Muon(network, rate=config.rate, weight_decay=config.weight_decay)
    return torch.optim.AdamW(network.parameters(), lr=config.rate, weight_decay=config.weight_decay)


class Muon(Optimizer):
    """Momentum, orthogonalised: K. Jordan et al., "Muon: An optimizer for hidden layers in neural networks", 2024.

    A convolution is the matrix [outputs, inputs x taps]: its step has all singular values near 1, so that no direction
    starves beside a steep one. Steps are scaled to the size of AdamW's (J. Liu et al., "Muon is scalable for LLM
    training", 2025). Single rows and everything that is no matrix (biases, scales) go by Adam, with the same decay.
    """

    def __init__(self, network: nn.Module, *, rate: float, weight_decay: float) -> None:
        super().__init__(network.parameters(), {"lr": rate, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self) -> None:  # type: ignore[override]
        """Take one step along the gradients that are there."""
        for group in self.param_groups:
            shapes: dict[tuple[int, ...], list[Tensor]] = defaultdict(list)
            others: list[Tensor] = []
            for parameter in group["params"]:
                if parameter.grad is not None:
                    by_matrix = parameter.ndim >= 4 and parameter.shape[0] > 1
                    (shapes[tuple(parameter.flatten(1).shape)] if by_matrix else others).append(parameter)
            for parameters in shapes.values():
                self._step_matrices(parameters, group["lr"], group["weight_decay"])
            self._step_others(others, group["lr"], group["weight_decay"])

    def _step_matrices(self, parameters: list[Tensor], rate: float, decay: float) -> None:
        """Move parameters whose matrices have one shape: together, because there are many small ones."""
        ahead = []
        for parameter in parameters:
            state, gradient = self.state[parameter], parameter.grad
            assert gradient is not None
            if not state:
                state["momentum"] = torch.zeros_like(parameter)
            mean = state["momentum"].lerp_(gradient, 1.0 - MOMENTUM)
            ahead.append(gradient.lerp(mean, MOMENTUM).flatten(1))
        directions = orthogonalised(torch.stack(ahead)) * (ADAMW_SIZE * max(ahead[0].shape) ** 0.5)
        for parameter, direction in zip(parameters, directions, strict=True):
            parameter.mul_(1.0 - rate * decay).add_(direction.reshape(parameter.shape), alpha=-rate)

    def _step_others(self, parameters: list[Tensor], rate: float, decay: float) -> None:
        for parameter in parameters:
            if not self.state[parameter]:
                zeros = {name: torch.zeros_like(parameter) for name in ADAM_STATE}
                self.state[parameter] |= {"step": torch.zeros(()), **zeros}
        states = [self.state[parameter] for parameter in parameters]
        (first, second), (mean, square) = ADAM_MOMENTA, ADAM_STATE
        adamw(
            parameters,
            [parameter.grad for parameter in parameters if parameter.grad is not None],
            [state[mean] for state in states],
            [state[square] for state in states],
            [],
            [state["step"] for state in states],
            amsgrad=False,
            beta1=first,
            beta2=second,
            lr=rate,
            weight_decay=decay,
            eps=SMALLEST,
            maximize=False,
        )


def orthogonalised(matrices: Tensor) -> Tensor:
    """Return matrices [..., m, n] of the same singular vectors whose singular values lie near 1, within about 0.3."""
    tall = matrices.shape[-2] > matrices.shape[-1]
    x: Tensor = matrices.mT if tall else matrices
    x = x / (torch.linalg.matrix_norm(x, keepdim=True) + SMALLEST)
    linear, cubic, quintic = QUINTIC
    for _ in range(ROUNDS):
        square = x @ x.mT
        x = linear * x + (cubic * square + quintic * square @ square) @ x
    return x.mT if tall else x
