"""Random plausible stereo rigs for the tests of the compiled core."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from endosdk import _core


def available_isas() -> list[str]:
    """Names of the instruction sets that this processor runs."""
    before = _core.isa()
    names = []
    for name in ("plain", "avx2", "avx512"):
        try:
            _core.set_isa(name)
        except ValueError:
            continue
        names.append(name)
    _core.set_isa(before)
    return names


ISAS = available_isas()
every_isa = pytest.mark.parametrize("isa", ISAS)


def rotation(vector: np.ndarray) -> np.ndarray:
    """Rotation matrix of an axis-angle vector."""
    import cv2

    return cv2.Rodrigues(np.asarray(vector, float))[0]


@dataclass
class Rig:
    """Numbers of a rig as the compiled module takes them."""

    model: str
    size: tuple[int, int]
    K1: np.ndarray
    D1: np.ndarray
    K2: np.ndarray
    D2: np.ndarray
    R: np.ndarray
    T: np.ndarray

    def rectified(self, alpha: float = 0.0) -> tuple[np.ndarray, ...]:
        """R1, R2, P1, P2."""
        return _core.stereo_rectify(self.model, self.K1, self.D1, self.K2, self.D2, self.R, self.T, *self.size, alpha)

    def views(self, alpha: float = 0.0) -> tuple[tuple, tuple]:
        """What `Rectifier` takes for left and right."""
        R1, R2, P1, P2 = self.rectified(alpha)
        return (self.model, self.K1, self.D1, R1, P1), (self.model, self.K2, self.D2, R2, P2)

    def rectifier(self, alpha: float = 0.0, size: tuple[int, int] | None = None) -> _core.Rectifier:
        """A rectifier of this rig."""
        return _core.Rectifier(*self.size, *(size or self.size), *self.views(alpha))


def random_rig(seed: int, coefficients: int = 5, model: str = "pinhole", size: tuple[int, int] = (160, 120)) -> Rig:
    """Two similar cameras of an endoscope: focal lengths within percents, a few degrees apart, lenses alike."""
    rng = np.random.default_rng(seed)
    width, height = size
    focal = width * (rng.uniform(0.8, 1.2) if model == "pinhole" else rng.uniform(0.5, 0.7))

    def matrix() -> np.ndarray:
        fx, fy = focal * rng.uniform(0.98, 1.02, 2)
        cx, cy = width * (0.5 + rng.uniform(-0.03, 0.03)), height * (0.5 + rng.uniform(-0.03, 0.03))
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    if model == "pinhole":
        spread = np.array([0.2, 0.05, 0.002, 0.002, 0.02, 0.02, 0.02, 0.02])
        common = rng.uniform(-1, 0.4, 8) * spread
    else:
        common = rng.uniform(-0.02, 0.02, 8)
    distortion = [(common * rng.uniform(0.9, 1.1, 8))[:coefficients] for _ in range(2)]
    translation = np.array([-rng.uniform(3, 8), rng.normal(0, 0.1), rng.normal(0, 0.1)])
    return Rig(
        model, size, matrix(), distortion[0], matrix(), distortion[1], rotation(rng.normal(0, 0.02, 3)), translation
    )
