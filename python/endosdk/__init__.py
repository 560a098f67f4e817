"""Stereo depth for binocular endoscopes."""

from endosdk._core import version as __version__

__all__ = ["__version__"]
