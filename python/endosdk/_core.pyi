"""Types of the compiled kernels. Private: use the package `endosdk` instead.

Arrays are C-contiguous unless said. Wrong types, shapes or values raise ``ValueError`` naming argument, rule and value.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

version: str

_Isa = Literal["avx512", "avx2", "plain"]
_Order = Literal["rgb", "bgr", "gray"]
_Model = Literal["pinhole", "fisheye"]
_Matrix = NDArray[np.float64]
_Map = NDArray[np.float32]
_Bytes = NDArray[np.uint8]

# Model, K 3x3, distortion, R 3x3, P 3x4 of one view.
_View = tuple[str, ArrayLike, ArrayLike, ArrayLike, ArrayLike]

def isa() -> _Isa: ...
def set_isa(name: str) -> None: ...

# Answers this close to an end of the network's range, px of the network, count as out of range.
range_margin: float

def default_threads() -> int:
    """Return the number of cores that this process may use, but at most 8."""

def threads() -> int:
    """Return how many threads kernels called from this thread may use."""

def set_threads(n: int) -> None:
    """Set that number for the calling thread, 1 to 256."""

def has_integer_units() -> bool:
    """Whether this processor has instructions for 8-bit networks (VNNI)."""

def usual_network_size(width: int, height: int, usual_width: int) -> tuple[int, int]:
    """Return (width, height) at which the network sees a frame when the caller sets none."""

def stereo_rectify(
    model: _Model | str,
    K1: ArrayLike,
    D1: ArrayLike,
    K2: ArrayLike,
    D2: ArrayLike,
    R: ArrayLike,
    T: ArrayLike,
    width: int,
    height: int,
    alpha: float,
) -> tuple[_Matrix, _Matrix, _Matrix, _Matrix]:
    """R1, R2 (3x3), P1, P2 (3x4), as cv2.stereoRectify with CALIB_ZERO_DISPARITY.

    Fisheye rigs: as cv2.fisheye.stereoRectify with balance=alpha.
    """

def undistort_map(
    model: _Model | str, K: ArrayLike, D: ArrayLike, R: ArrayLike, P: ArrayLike, width: int, height: int
) -> tuple[_Map, _Map]:
    """Raw x and y (float32 [height, width]) of every rectified pixel; NaN for rays that point backwards."""

class Rectifier:
    """Turns raw pairs into rectified planar RGB. Immutable once built: one object may serve several threads.

    Positions beyond the middle of the outermost pixels fade into black as by OpenCV; with ``whole_border``, which suits
    pictures that are only resized, they read those pixels as long as they lie on them.
    """

    def __init__(
        self,
        width: int,
        height: int,
        out_width: int,
        out_height: int,
        left: _View,
        right: _View,
        whole_border: bool = False,
    ) -> None: ...
    def rectify(self, left: _Bytes, right: _Bytes, out_left: _Bytes, out_right: _Bytes, order: _Order | str) -> None:
        """Rectify a pair of uint8 [H, W, 3] ([H, W] or [H, W, 1] for gray; rows may be strided) into given arrays.

        Outputs are uint8 [3, Hp, Wp], at least the rectified size; the last column and row fill the rest.
        """

    @property
    def valid_left(self) -> _Bytes:
        """uint8 [out_height, out_width], 1 where the source lies inside the raw image and the lens model holds."""

    @property
    def valid_right(self) -> _Bytes: ...

def pack(left: _Bytes, right: _Bytes, out_left: _Bytes, out_right: _Bytes, order: _Order | str) -> None:
    """Rewrite an already rectified pair as padded planar RGB; arrays as for `Rectifier.rectify`."""

def same_pixels(left: _Bytes, right: _Bytes) -> bool:
    """Whether two frames, as for `Rectifier.rectify`, hold the same bytes."""

def resize_bilinear(src: _Map, out: _Map, scale_y: float, scale_x: float, gain: float) -> None:
    """Resize with half-pixel centres and clamped edges, and multiply by ``gain``.

    ``scale`` is source size over full output size; ``out`` may be the top left part of the full output.
    """

def postprocess(
    disparity: _Map,
    confidence: _Map,
    scale_y: float,
    scale_x: float,
    gain: float,
    out_disparity: _Map,
    out_confidence: _Map,
    out_reasons: _Bytes,
    image: _Bytes | None,
    valid_left: _Bytes | None,
    valid_right: _Bytes | None,
    min_confidence: float,
    out_depth: _Map | None = None,
    out_sigma: _Map | None = None,
    focal_px: float = 0.0,
    baseline_mm: float = 0.0,
    doffs: float = 0.0,
    min_depth_mm: float = 0.0,
    max_depth_mm: float = ...,
    image_scale_y: float = 1.0,
    image_scale_x: float = 1.0,
    last_plane: float = 0.0,
    right_image: _Bytes | None = None,
    same_frames: bool = False,
    right_shift: float = 0.0,
) -> int:
    """Fill the full-size maps of one frame and return the number of pixels with ``reasons == 0``.

    Inputs float32 [h, w], maps [H, W], ``image`` uint8 [3, Hp, Wp] planar, of which an
    output pixel takes the nearest (``image_scale``: image pixels per output pixel). Depth and sigma (mm) are NaN where
    a pixel has a reason; both need ``focal_px`` and ``baseline_mm``. Half a pixel before ``last_plane`` (px of the
    input; 0: not known) and beyond a pixel is out of range. With ``right_image``, of the shape of ``image``, confidence
    becomes 0 where the two do not agree at the disparity found, and everywhere with ``same_frames``: both cameras gave
    the same bytes. ``right_shift`` is how far, px of the maps, the right view was moved to the left before the network
    saw it; disparities come out as without that.
    """
