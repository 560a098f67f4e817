"""The optimisers that a run may use."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.optim import Optimizer

from endosdk.training.config import TrainConfig

# Of the quintic x (a + b x^2 + c x^4), which brings every singular value of 0..1 near to 1 in five rounds.
QUINTIC = (3.4445, -4.7750, 2.0315)
ROUNDS = 5
ADAMW_SIZE = 0.2  # how much AdamW usually moves a weight, as a share of the rate: so both go by the same rate
SMALLEST = 1e-7
MOMENTUM = 0.95
ADAM_MOMENTA = 0.9, 0.999  # of the gradient and of its square


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
            for parameter in group["params"]:
                if parameter.grad is None:
                    continue
                parameter.mul_(1.0 - group["lr"] * group["weight_decay"])
                by_matrix = parameter.ndim >= 4 and parameter.shape[0] > 1
                direction = self._orthogonal(parameter) if by_matrix else self._adam(parameter)
                parameter.add_(direction, alpha=-group["lr"])

    def _orthogonal(self, parameter: Tensor) -> Tensor:
        state, gradient = self.state[parameter], parameter.grad
        assert gradient is not None
        if not state:
            state["momentum"] = torch.zeros_like(parameter)
        mean = state["momentum"].lerp_(gradient, 1.0 - MOMENTUM)
        ahead = gradient.lerp(mean, MOMENTUM).flatten(1)
        size: float = ADAMW_SIZE * max(ahead.shape) ** 0.5
        direction: Tensor = orthogonalised(ahead) * size
        return direction.view(parameter.shape)

    def _adam(self, parameter: Tensor) -> Tensor:
        state, gradient = self.state[parameter], parameter.grad
        assert gradient is not None
        if not state:
            state["step"] = torch.zeros(())
            state["exp_avg"], state["exp_avg_sq"] = torch.zeros_like(parameter), torch.zeros_like(parameter)
        state["step"] += 1
        taken = float(state["step"])
        first, second = ADAM_MOMENTA
        mean = state["exp_avg"].lerp_(gradient, 1.0 - first) / (1.0 - first**taken)
        square = state["exp_avg_sq"].lerp_(gradient.square(), 1.0 - second) / (1.0 - second**taken)
        direction: Tensor = mean / (square.sqrt() + SMALLEST)
        return direction


def orthogonalised(matrix: Tensor) -> Tensor:
    """Return a matrix [m, n] of the same singular vectors whose singular values lie near 1, within about 0.3."""
    tall = matrix.shape[0] > matrix.shape[1]
    x: Tensor = matrix.T if tall else matrix
    x = x / (x.norm() + SMALLEST)
    linear, cubic, quintic = QUINTIC
    for _ in range(ROUNDS):
        square = x @ x.T
        x = linear * x + (cubic * square + quintic * square @ square) @ x
    return x.T if tall else x
