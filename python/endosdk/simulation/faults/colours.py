"""Light that is not white: narrow-band and fluorescence pictures, grey ones, and odd tints; the same for both eyes."""

from __future__ import annotations

import numpy as np

from endosdk.simulation.noise import Array

LOOKS = {"white": 0.76, "narrow band": 0.07, "fluorescence": 0.06, "grey": 0.06, "tinted": 0.05}


def draw_look(rng: np.random.Generator) -> str:
    """Draw the name of a look."""
    return str(rng.choice(list(LOOKS), p=list(LOOKS.values())))


def recolour(view: Array, look: str, seed: tuple[int, ...]) -> Array:
    """Return a view [H,W,3], 0..255, in another light. Every pixel changes by its own colour, so both eyes agree."""
    rng = np.random.default_rng(seed)
    if look == "narrow band":  # green light goes to red, blue light to green and blue; red light is not there
        green, blue = view[..., 1], view[..., 2]
        deep = np.stack([1.05 * green, 0.35 * green + 0.6 * blue, 0.3 * green + 0.65 * blue], -1)
        return np.asarray(deep * rng.uniform(0.9, 1.3), np.float32)
    grey = view @ np.array([0.3, 0.55, 0.15], np.float32)
    if (
        look == "fluorescence"
    ):  # a dim grey picture, green where the dye is: here, where the tissue has a certain colour
        hue = (view[..., 0] - view[..., 1]) / np.maximum(grey, 20.0)
        dye = np.clip((hue - rng.uniform(0.0, 0.7)) * 6.0, 0.0, 1.0)
        base = rng.uniform(0.35, 0.9) * grey
        return np.asarray(
            np.stack([base * (1 - 0.6 * dye), base + dye * (0.5 * grey + 30), base * (1 - 0.4 * dye)], -1), np.float32
        )
    if look == "grey":
        return np.repeat(grey[..., None], 3, axis=-1).astype(np.float32)
    if look == "tinted":
        mix = np.eye(3) + rng.normal(0, 0.25, (3, 3))
        return np.asarray(view @ (mix / mix.sum(0, keepdims=True)).astype(np.float32), np.float32)
    return view
