"""Types of the compiled kernels. Private: use the package `endosdk` instead.

Arrays are C-contiguous unless said. Wrong types, shapes or values raise `endosdk.errors.InvalidArgument`.
"""

import enum
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

version: str

class Reason(enum.IntFlag):
    """Why a pixel is not valid: the bits of `reasons`."""

    LOW_CONFIDENCE = 1
    OCCLUDED = 2
    OUTSIDE_OVERLAP = 4
    OUT_OF_RANGE = 8
    SATURATED = 16
    OUTSIDE_VIEW = 32

class Status(enum.IntEnum):
    """One word on a whole frame, which follows from its causes."""

    OK = 0
    DEGRADED = 1
    INVALID = 2

class Cause(enum.IntEnum):
    """What is wrong with a frame."""

    COVERED = 0
    SATURATED = 1
    BLURRED = 2
    DIM = 3
    FROZEN = 4
    NOT_SIMULTANEOUS = 5
    SAME_VIEW_TWICE = 6
    SWAPPED = 7
    NOT_RECTIFIED = 8
    RIG_MOVED = 9
    OUT_OF_RANGE = 10
    LOW_TEXTURE = 11
    LATE = 12
    VIEWS_DIFFER = 13
    FEW_VALID = 14
    STALE = 15
    REPEATED_PATTERN = 16
    SCALES_DIFFER = 17
    INTERLACED = 18
    DISTORTED = 19

class _CauseFact(TypedDict):
    measure: str  # what the number counts, and in which unit
    bad: Literal["high", "low"]  # which side of the limits is bad
    degraded: float
    invalid: float  # NaN: never
    meaning: str
    remedy: str

# The table from which a frame's status follows.
cause_facts: dict[Cause, _CauseFact]

def least_turn_deg(focal_widths: float) -> float:
    """Rotation from which RIG_MOVED is raised, with a lens of this focal length in widths of the frame."""

# What a metric output without a calibration is refused with.
calibration_rule: str

# The constants of joint bilateral upsampling, and how a model's metadata states them.
output_maps: tuple[tuple[str, np.dtype[Any], bool], ...]  # name, type, whether it needs a calibration
upsampling_reach: int
upsampling_unlike: float
upsampling_least_likeness: float
upsampling_metadata: str

# ONNX Runtime's own names of the providers that have short ones, by those.
providers: dict[str, str]
cpu_provider: str

def full_provider_name(name: str) -> str:
    """Return ONNX Runtime's own name of a provider; short and full names are taken in any case."""

def parse_provider_options(texts: list[str]) -> list[tuple[str, str]]:
    """Return keys and values of texts of the form key=value."""

def checked_provider_options(provider: str, options: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the options of a provider, with whole 32-bit floats unless they say otherwise; wrong ones are refused."""

def check_placement(provider: str, nodes: dict[str, list[tuple[str, str]]], model: bytes, origin: str) -> None:
    """Refuse a placement, (operation, name) of the nodes on each provider, if the provider does not compute the model.

    ``model`` is the content of the file, which tells the arithmetic of indices from that of pictures.
    """

def wants_float32_model(provider: str) -> bool:
    """Whether a float32 model is to be preferred to an 8-bit one, on this provider and this processor."""

def waiting_settings(polls: bool) -> dict[str, str]:
    """Return how threads of ONNX Runtime wait for one another: settings of its sessions."""

def is_out_of_resources(message: str) -> bool:
    """Return whether the text of an error of ONNX Runtime says that memory or threads are used up."""

def require_memory_for_runtime() -> None:
    """Raise OutOfMemory unless the system has enough memory left to load ONNX Runtime."""

def require_memory_for_session(threads: int, model_bytes: int) -> None:
    """Raise OutOfMemory unless the system has enough memory left to make a session of a model file."""

def parse_metadata(metadata: dict[str, str], sha256: str) -> dict[str, Any]:
    """Return what a model says of itself, by field of `ModelInfo`; name the key that is missing or wrong."""

def check_weights_are_inside(model: bytes, origin: str) -> None:
    """Refuse a model that keeps weights in another file: its hash would not cover them."""

# The seal of a model: its metadata key, the value before it is sealed, and the bytes before the digits in a file.
seal_key: str
empty_seal: str
seal_mark: bytes

def check_seal(model: bytes, origin: str) -> bool:
    """Return whether a model is sealed. Raises ModelHashMismatch where its bytes are not those that were sealed."""

def seal(model: bytes) -> bytes:
    """Return the bytes of a model, whose seal is empty, with the hash in its place."""

_Isa = Literal["avx512", "avx2", "plain"]
_Order = Literal["rgb", "bgr", "gray"]
_Model = Literal["pinhole", "fisheye"]
_Matrix = NDArray[np.float64]
_Map = NDArray[np.float32]
_Bytes = NDArray[np.uint8]

# Model, K 3x3, distortion, R 3x3, P 3x4 of one view.
_View = tuple[str, ArrayLike, ArrayLike, ArrayLike, ArrayLike]

# Every instruction set of this build, best first, whether this processor runs it or not.
kernel_sets: tuple[_Isa, ...]

def isa() -> _Isa: ...
def set_isa(name: str) -> None: ...

# Confidence is that of an error up to one of so many parts of the frame's width.
confidence_parts: float
default_min_confidence: float

longest_side: int  # of a frame, px
model_key_prefix: str  # of our keys in a model's metadata
model_format_version: str
certain_standard_errors: float
max_threads: int
# Answers this close to an end of the network's range, px of the network, count as out of range.
range_margin: float

# Of all channels: from here on a pixel is glare.
saturation_level: int

def default_threads() -> int:
    """Return the number of cores that this process may use, but at most 8."""

def threads() -> int:
    """Return how many threads kernels called from this thread may use."""

def set_threads(n: int) -> None:
    """Set that number for the calling thread, 1 to 256."""

def reserve_threads(n: int) -> None:
    """Raise OutOfMemory unless the system can start so many further threads at a time. None of them stays."""

def has_integer_units() -> bool:
    """Whether this processor has instructions for 8-bit networks: AVX2, or dot products on ARM."""

def network_size_of(width: int, height: int, inference_width: int) -> tuple[int, int]:
    """Return (width, height) at which the network sees a frame when the caller sets none."""

def check_camera_matrix(matrix: ArrayLike, name: str) -> None: ...
def check_distortion(coefficients: ArrayLike, fisheye: bool, name: str) -> None: ...
def check_rotation(rotation: ArrayLike, name: str) -> None: ...
def check_translation(translation: ArrayLike, name: str) -> None: ...
def check_field_of_view(field: ArrayLike, width: int, height: int, name: str) -> None:
    """Refuse a field of view, middle x, y and half axes x, y, that is no ellipse in a frame of this size, px."""

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
    """R1, R2 (3x3), P1, P2 (3x4), as cv2.stereoRectify with CALIB_ZERO_DISPARITY, but see `StereoCalibration`.

    Fisheye rigs: as cv2.fisheye.stereoRectify with balance=alpha.
    """

def rig_geometry(rig: _Rig | tuple[Any, ...], alpha: float) -> tuple[_Matrix, _Matrix, _Matrix, _Matrix]:
    """R1, R2 (3x3), P1, P2 (3x4) of the rectified pair of a rig."""

def is_rectified(rig: _Rig | tuple[Any, ...]) -> bool:
    """Whether pictures of a rig need no rectification."""

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

def combed_share(frame: _Bytes) -> float:
    """Share of the tiles of a raw frame in which neighbouring rows differ clearly more than rows two apart."""

def displacement_of_frames(left: _Bytes, right: _Bytes) -> tuple[float, float]:
    """How far apart two frames show their texture, thousandths of the width; NaN where too little is textured.

    Frames as for `Rectifier.rectify`.
    """

def equal_blocks(left: _Bytes, right: _Bytes) -> _Bytes:
    """uint8 [blocks down, blocks along]: 0 where the frames differ, 1 where they are equal, 2 with equal steps.

    All are 0 where none is 2. Frames as for `Rectifier.rectify`, both of one shape.
    """

# Frames that are less apart are one view; what is farther apart than can be told is as far as this.
displacement_of_one_view: float
rest_of_one_view: float
farthest_displacement: float
rig_file_format: str
rig_file_version: int
plausible_baseline_mm: tuple[float, float]

def resize_bilinear(src: _Map, out: _Map, scale_y: float, scale_x: float, gain: float) -> None:
    """Resize with half-pixel centres and clamped edges, and multiply by ``gain``.

    ``scale`` is source size over full output size; ``out`` may be the top left part of the full output.
    """

def postprocess(fields: Mapping[str, Any], out: Mapping[str, Any]) -> int:
    """Fill the full-size maps of one frame and return the number of valid pixels. For tests and studies.

    Fields are those of ``PostprocessInput`` in ``cpp/src/maps/postprocess.hpp``: grids float32 [h, w], ``scale`` and
    ``view_scale`` (y, x) in grid and view pixels per output pixel, ``gain`` in output pixels per network pixel, views
    uint8 [3, Hp, Wp] planar, masks uint8 [H, W]. Maps are [H, W]. Depth and sigma (mm) are NaN where a pixel has a
    reason; both need ``focal_px`` and ``baseline_mm``.
    """

_Rig = tuple[str, int, int, ArrayLike, ArrayLike, ArrayLike, ArrayLike, ArrayLike, ArrayLike, ArrayLike, ArrayLike]
_OutputMaps = tuple[_Map, _Map, _Bytes, _Map | None, _Map | None]

def nearest_depth_mm(rig: _Rig | tuple[Any, ...], max_candidate_disparity: int, inference_width: int) -> float:
    """Nearest depth, mm, that a model sees on a rig at its usual size; NaN where its range is 0: not stated."""

def rotation_matrix(vector: _Matrix) -> _Matrix:
    """Return the rotation matrix of an axis times an angle, radians."""

def rig_error(
    disparity: _Map,
    confidence: _Map,
    left: _Bytes,
    right: _Bytes,
    picture: tuple[int, int],
    frame: tuple[float, float],
    pattern: tuple[float, float, float, float, float],
) -> _Pose | None:
    """Return the pose error that explains what is left across the rows."""

def coarse_match(left: _Bytes, right: _Bytes, picture: tuple[int, int]) -> tuple[float, float]:
    """Return what exchanging the views gains in correlation, and the rows by which matches lie lower."""

def share_of_rivals(left: _Bytes, right: _Bytes, picture: tuple[int, int]) -> float:
    """Share of the textured patches of the left view that match at two places of their row."""

def row_misfit(rest: _Map, least: float) -> tuple[float, _Map | None]:
    """Share of the parts of a picture that no rig explains; 0 there and beside them, 1 elsewhere, if distorted."""

def lag_of(moved_px: Sequence[float], rows_px: Sequence[float]) -> tuple[float, float]:
    """Return by how many frames the right view is late, and the standard error of that.

    Args:
        moved_px: the rows by which the left picture's content lay lower in the frame before, one number a frame.
        rows_px: the rows by which matches lie lower in the right view than in the left one.
    """

def rectified_views(left: _Bytes, right: _Bytes, rig: _Rig | tuple[Any, ...]) -> tuple[_Bytes, _Bytes]:
    """Return the rectified views of one pair at its own size."""

class TemporalFilter:
    """Disparity of one camera's frames, made steady in time."""

    def smooth(
        self, left: _Bytes, picture: tuple[int, int], disparity: _Map, confidence: _Map, cells_per_pixel: float
    ) -> None:
        """Draw a frame's disparity, in place, towards that of the frame before."""

_Camera = tuple[float, float, float, float]

correlation_share: float
mean_square_share: float

def point_at(depth: _Map, sigma: _Map, reasons: _Bytes, camera: _Camera, x: float, y: float) -> tuple[_Matrix, _Matrix]:
    """Return the point [1,3] that a pixel shows and its covariance [3,3]; ``camera`` is focal lengths and centre."""

def path_length(depth: _Map, sigma: _Map, reasons: _Bytes, camera: _Camera, pixels: _Matrix) -> tuple[float, float]:
    """Return the length of the line through the points at pixels [n,2], and its standard error."""

def area(
    depth: _Map, sigma: _Map, reasons: _Bytes, camera: _Camera, polygon: _Matrix
) -> tuple[float, float, float, float, float]:
    """Return flat area, relief, each with its standard error, and the share of pixels with depth."""

class PixelMap:
    """Raw and rectified pixels of one rig."""

    def __init__(self, rig: _Rig | tuple[Any, ...], alpha: float) -> None: ...
    def to_raw(self, right: bool, pixels: _Matrix) -> _Matrix: ...
    def to_rectified(self, right: bool, pixels: _Matrix) -> _Matrix: ...
    def region(self) -> list[int]: ...

_Pose = tuple[list[float], list[float], float, float]

class FrameReport:
    """What is said of one frame besides its maps."""

    @property
    def frame(self) -> int: ...
    @property
    def valid_share(self) -> float: ...
    @property
    def status(self) -> Status: ...
    @property
    def causes(self) -> dict[Cause, float]:
        """What is wrong with the frame, with the measure of each."""
    @property
    def measures(self) -> dict[Cause, float]:
        """All that was measured, wrong or not."""
    @property
    def pose(self) -> _Pose | None:
        """The rig against its calibration: values and covariance, radians; vertical disparity, px, and its error."""
    @property
    def steady(self) -> _Pose | None:
        """The same over the frames so far, corrections not counted."""
    @property
    def drifted(self) -> bool: ...
    @property
    def corrected(self) -> list[float]:
        """What the rectification of this frame made up for, radians."""
    @property
    def rectify_ms(self) -> float: ...
    @property
    def session_ms(self) -> float: ...
    @property
    def postprocess_ms(self) -> float: ...
    @property
    def total_ms(self) -> float: ...
    @property
    def late(self) -> bool: ...
    @property
    def stamp_ns(self) -> int: ...
    @property
    def age_ms(self) -> float: ...
    @property
    def identity(self) -> Identity: ...

class Identity:
    """What a result was computed with: versions, hashes, provider and processor. Empty where there is none.

    Two are equal where all of these are.
    """

    @property
    def endosdk(self) -> str: ...
    @property
    def model(self) -> str: ...
    @property
    def model_version(self) -> str: ...
    @property
    def model_sha256(self) -> str: ...
    @property
    def calibration_sha256(self) -> str: ...
    @property
    def runtime(self) -> str:
        """Version of ONNX Runtime."""
    @property
    def runtime_sha256(self) -> str:
        """Hash of the file that holds ONNX Runtime."""
    @property
    def provider(self) -> str:
        """What computed the network, by the runtime's own name."""
    @property
    def device(self) -> str:
        """The processor of this machine, by its maker's name."""

class Stream:
    """Frames in flight; one thread may submit while another receives."""

    @property
    def lanes(self) -> int:
        """How many frames may be submitted before one must be received."""

    def wait_for_room(self) -> bool:
        """Wait until one more frame may be submitted; False when the stream is over."""

    def follow_rig(self) -> None:
        """Let the rectification make up for turns of the rig from now on."""

    def submit(self, left: _Bytes, right: _Bytes, maps: _OutputMaps, stamp_ns: int) -> None:
        """Hand a frame over and return once it was read."""

    def receive(self) -> tuple[FrameReport, Any] | None:
        """Wait for the oldest frame: what is said of it, and its maps. None when the stream is over."""

    def end(self) -> None:
        """Say that no frame follows."""

    def close(self) -> None:
        """End the stream and wait for what is being computed."""

class FramePathSettings:
    """What a host may choose of a frame path, checked."""

    def __init__(
        self,
        channel_order: str,
        threads: int,
        network_size: tuple[int, int] | None,
        min_confidence: float,
        depth_range_mm: tuple[float, float],
        deadline_ms: float,
        max_age_ms: float,
    ) -> None: ...
    @property
    def threads(self) -> int: ...

class FramePath:
    """The whole way of a frame around a session that Python brings."""

    def __init__(self, session: Any, settings: FramePathSettings) -> None: ...
    def set_calibration(self, rig: _Rig | tuple[Any, ...]) -> None: ...
    def predict(self, left: _Bytes, right: _Bytes, maps: _OutputMaps, stamp_ns: int) -> FrameReport: ...
    def stream(self, width: int, height: int, temporal: bool) -> Stream: ...
    def rectify(self, left: _Bytes, right: _Bytes) -> tuple[_Bytes, _Bytes]: ...
    def rectified(self) -> tuple[_Bytes, _Bytes]: ...
    def prepare(self, width: int, height: int) -> None: ...
    def cancel(self) -> None: ...
    def self_test(self) -> None: ...
    def cells_of_answer(self) -> tuple[_Map, _Map]:
        """Mean disparity and confidence, [rows, columns] of cells, of the built-in pair with a golden answer."""

    def close(self) -> None: ...
    def largest_disparity(self, width: int, height: int) -> float: ...
    def nearest_depth_mm(self) -> float: ...
    def diagnostics(self) -> str: ...

def model_function(name: str, inputs: Sequence[NDArray[Any]], settings: Mapping[str, float]) -> list[NDArray[Any]]:
    """Compute a function of model files. Its outputs, in its order; for tests and studies."""
