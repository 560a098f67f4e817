import threading

import numpy as np
import pytest

import endosdk
from endosdk import DepthEstimator, Reason, Status, StereoCalibration, _core, errors
from tests.conftest import TINY_MODEL, shifted_pair, textured_picture
from tests.runtime.plane import HEIGHT, SHIFT, WIDTH, rectified_rig


def raw_rig():
    """A small rig with distortion and misalignment, such as a real one has before rectification."""
    angle = np.radians([0.6, 0.4, -0.8])
    cx, sx = np.cos(angle[0]), np.sin(angle[0])
    cz, sz = np.cos(angle[2]), np.sin(angle[2])
    rotation = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    matrix = np.array([[150.0, 0, 80], [0, 150, 48], [0, 0, 1]])
    return StereoCalibration(
        width=WIDTH,
        height=HEIGHT,
        left_matrix=matrix,
        right_matrix=matrix,
        left_distortion=np.array([-0.1, 0.01, 0, 0, 0]),
        right_distortion=np.array([-0.11, 0.01, 0, 0, 0]),
        rotation=rotation,
        translation=np.array([-5.0, 0.05, 0.02]),
    )


def inner(values):
    return values[8:-8, SHIFT + 36 : -8]


def test_disparity_of_a_plane(pair):
    result = DepthEstimator(TINY_MODEL).predict(*pair)
    assert result.disparity.shape == (HEIGHT, WIDTH)
    assert np.median(np.abs(inner(result.disparity) - SHIFT)) < 0.1
    assert result.status is Status.OK
    assert result.frame == 1
    assert result.model.sha256 == endosdk.runtime.models.read_model(TINY_MODEL).sha256


def test_metric_depth_of_a_plane(pair):
    result = DepthEstimator(TINY_MODEL, calibration=rectified_rig(), min_confidence=0.3).predict(*pair)
    expected = 200.0 * 5.0 / SHIFT
    assert np.nanmedian(inner(result.depth)) == pytest.approx(expected, rel=0.01)
    assert np.array_equal(np.isnan(result.depth), result.reasons != 0)
    assert np.array_equal(np.isnan(result.sigma), result.reasons != 0)
    points = result.points()
    assert points.shape == (HEIGHT, WIDTH, 3)
    row, column = HEIGHT // 2, WIDTH - 20
    depth = result.depth[row, column]
    assert points[row, column] == pytest.approx(
        [(column - result.geometry.cx) * depth / 200, (row - result.geometry.cy) * depth / 200, depth], rel=1e-5
    )


def test_depth_without_calibration_says_what_to_do(pair):
    result = DepthEstimator(TINY_MODEL).predict(*pair)
    for name in ("depth", "sigma"):
        with pytest.raises(errors.CalibrationRequired, match="calibration=rig"):
            getattr(result, name)
    with pytest.raises(errors.CalibrationRequired):
        result.points()


def test_the_band_the_right_camera_cannot_see_is_outside_the_overlap(pair):
    result = DepthEstimator(TINY_MODEL).predict(*pair)
    blind = result.disparity > np.arange(WIDTH)
    assert blind.any()
    assert np.all((result.reasons & Reason.OUTSIDE_OVERLAP)[blind] != 0)


def test_glare_is_marked(pair):
    left, right = (view.copy() for view in pair)
    left[40:50, 100:110] = 255
    result = DepthEstimator(TINY_MODEL).predict(left, right)
    assert np.all((result.reasons & Reason.SATURATED)[40:50, 100:110] != 0)
    assert not np.any(result.reasons[:30] & Reason.SATURATED)


@pytest.mark.parametrize("size", [(96, 160), (97, 161), (89, 155), (104, 153)])
def test_any_size(size):
    result = DepthEstimator(TINY_MODEL).predict(*shifted_pair(*size, SHIFT))
    assert result.disparity.shape == size
    assert np.median(np.abs(inner(result.disparity) - SHIFT)) < 0.1


def test_size_may_change_between_frames(pair):
    estimator = DepthEstimator(TINY_MODEL)
    first = estimator.predict(*pair).disparity.copy()
    estimator.predict(*shifted_pair(64, 128, SHIFT))
    assert np.array_equal(estimator.predict(*pair).disparity, first)


def test_network_size_keeps_frame_pixels():
    left, right = shifted_pair(192, 320, 24)
    result = DepthEstimator(TINY_MODEL, network_size=(160, 96)).predict(left, right)
    assert result.disparity.shape == (192, 320)
    assert np.median(np.abs(inner(result.disparity) - 24)) < 0.3


def test_network_size_keeps_metric_depth_and_glare():
    left, right = shifted_pair(192, 320, 24)
    left = left.copy()
    left[80:100, 200:220] = 255
    rig = StereoCalibration.rectified(focal_px=400.0, baseline_mm=5.0, size=(320, 192))
    result = DepthEstimator(TINY_MODEL, calibration=rig, network_size=(160, 96)).predict(left, right)
    assert np.nanmedian(inner(result.depth)) == pytest.approx(400.0 * 5.0 / 24, rel=0.02)
    assert np.all((result.reasons & Reason.SATURATED)[84:96, 204:216] != 0)


def test_frames_are_seen_at_the_width_of_the_model():
    assert endosdk._core.network_size_of(960, 720, 0) == (960, 720)
    assert endosdk._core.network_size_of(1080, 1024, 0) == (720, 683)
    assert endosdk._core.network_size_of(960, 720, 480) == (480, 360)
    assert endosdk._core.network_size_of(1920, 1080, 480) == (480, 270)
    assert endosdk._core.network_size_of(320, 240, 480) == (480, 360)
    left, right = shifted_pair(96, 1200, 40)
    estimator = DepthEstimator(TINY_MODEL)
    result = estimator.predict(left, right)
    assert [estimator.diagnostics()[f"network_{side}"] for side in ("width", "height")] == [720, 58]
    assert result.disparity.shape == (96, 1200)
    # 40 px lie beyond the 32 that the model finds at full size.
    assert np.median(np.abs(result.disparity[16:-16, 200:-40] - 40)) < 0.5


def test_bgr_equals_rgb(pair):
    rgb = DepthEstimator(TINY_MODEL).predict(*pair)
    bgr = DepthEstimator(TINY_MODEL, channel_order="bgr").predict(*(view[..., ::-1] for view in pair))
    assert np.array_equal(rgb.disparity, bgr.disparity)


def test_gray_with_and_without_channel_axis(pair):
    gray = [view[..., 1] for view in pair]
    estimator = DepthEstimator(TINY_MODEL)
    flat = estimator.predict(*gray).disparity
    assert np.array_equal(estimator.predict(*(view[..., None] for view in gray)).disparity, flat)
    assert np.median(np.abs(inner(flat) - SHIFT)) < 0.1


def test_non_contiguous_frames_are_accepted(pair):
    estimator = DepthEstimator(TINY_MODEL)
    expected = estimator.predict(*pair).disparity
    wide = [np.zeros((HEIGHT, WIDTH + 7, 3), np.uint8) for _ in pair]
    for frame, view in zip(wide, pair, strict=True):
        frame[:, 3:-4] = view
    assert np.array_equal(estimator.predict(*(frame[:, 3:-4] for frame in wide)).disparity, expected)
    mirrored = [view[::-1].copy()[::-1] for view in pair]
    assert np.array_equal(estimator.predict(*mirrored).disparity, expected)


def test_raw_frames_are_rectified_inside():
    rig = raw_rig()
    estimator = DepthEstimator(TINY_MODEL, calibration=rig)
    left, right = textured_picture(HEIGHT, WIDTH, 1), textured_picture(HEIGHT, WIDTH, 2)
    result = estimator.predict(left, right)
    assert result.disparity.shape == (result.geometry.height, result.geometry.width) == (HEIGHT, WIDTH)
    import cv2

    geometry = rig.rectification()
    maps = cv2.initUndistortRectifyMap(
        rig.left_matrix, rig.left_distortion, geometry.R1, geometry.P1[:, :3], (WIDTH, HEIGHT), cv2.CV_32FC1
    )
    expected = cv2.remap(left, *maps, cv2.INTER_LINEAR)
    view, _ = estimator.rectified_pair()
    assert np.mean(np.abs(view.astype(int) - expected) <= 1) > 0.999


def test_out_reuses_memory_and_keeps_the_answer(pair):
    estimator = DepthEstimator(TINY_MODEL, calibration=rectified_rig())
    first = estimator.predict(*pair)
    expected = first.depth.copy()
    second = estimator.predict(*pair, out=first)
    assert second.disparity is first.disparity
    assert second.depth is first.depth
    assert second.frame == 2
    assert np.array_equal(second.depth, expected, equal_nan=True)


def test_results_do_not_share_memory_by_default(pair):
    estimator = DepthEstimator(TINY_MODEL)
    first = estimator.predict(*pair)
    kept = first.disparity.copy()
    estimator.predict(*shifted_pair(HEIGHT, WIDTH, 5))
    assert np.array_equal(first.disparity, kept)


def test_same_input_gives_the_same_bytes(pair):
    estimator = DepthEstimator(TINY_MODEL, calibration=rectified_rig())
    one, two = estimator.predict(*pair), estimator.predict(*pair)
    assert one.depth.tobytes() == two.depth.tobytes()
    assert one.confidence.tobytes() == two.confidence.tobytes()


def test_predict_from_many_threads(pair):
    estimator = DepthEstimator(TINY_MODEL)
    inputs = [shifted_pair(HEIGHT, WIDTH, shift) for shift in (3, 7, 11, 15)]
    expected = [estimator.predict(*views).disparity for views in inputs]
    wrong = []

    def work(index):
        for _ in range(5):
            if not np.array_equal(estimator.predict(*inputs[index]).disparity, expected[index]):
                wrong.append(index)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


@pytest.mark.parametrize("provider", ["cpu", "CPU", "CPUExecutionProvider", "cpuexecutionprovider"])
def test_every_name_of_the_processor_loads_the_same_model(provider):
    estimator = DepthEstimator("fast", provider=provider)
    assert estimator.diagnostics()["provider"] == "CPUExecutionProvider"
    assert estimator.model.name == DepthEstimator("fast").model.name


def test_threads_are_each_estimators_own(pair):
    usual = DepthEstimator(TINY_MODEL)
    alone = DepthEstimator(TINY_MODEL, threads=1)
    with pytest.raises(errors.ModelNotFound):
        DepthEstimator("no such model", threads=7)
    many = DepthEstimator(TINY_MODEL, threads=3)
    for estimator, threads in (
        (usual, _core.default_threads()),
        (alone, 1),
        (many, 3),
        (usual, _core.default_threads()),
    ):
        estimator.predict(*pair)
        assert estimator.diagnostics()["threads"] == threads
    assert DepthEstimator(TINY_MODEL).diagnostics()["threads"] == _core.default_threads()


def test_points_of_pixels_that_are_not_square(pair):
    rig = StereoCalibration.rectified(focal_px=400.0, baseline_mm=5.0, size=(2 * WIDTH, HEIGHT)).scaled(WIDTH, HEIGHT)
    result = DepthEstimator(TINY_MODEL, calibration=rig).predict(*pair)
    points = result.points()
    rows, columns = np.nonzero(result.reasons == 0)
    projected = points[rows, columns] @ result.geometry.P1[:, :3].T
    assert result.geometry.focal_y_px == pytest.approx(2 * result.geometry.focal_px)
    assert projected[:, 0] / projected[:, 2] == pytest.approx(columns, abs=0.01)
    assert projected[:, 1] / projected[:, 2] == pytest.approx(rows, abs=0.01)


@pytest.mark.parametrize("disparity", [-4, 3, SHIFT])
def test_a_rectified_rig_with_principal_points_apart_sees_beyond_disparity_zero(disparity):
    # The right view of a plane is moved, as that of cameras turned towards each other.
    doffs = 8
    left, right = shifted_pair(HEIGHT, WIDTH, disparity + doffs)
    right = np.pad(right, ((0, 0), (doffs, 0), (0, 0)), mode="edge")[:, :WIDTH]
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(WIDTH, HEIGHT), doffs=doffs)
    estimator = DepthEstimator(TINY_MODEL, calibration=rig, min_confidence=0.3)
    result = estimator.predict(left, right)
    assert np.median(np.abs(inner(result.disparity) - disparity)) < 0.2
    assert np.nanmedian(inner(result.depth)) == pytest.approx(200.0 * 5.0 / (disparity + doffs), rel=0.03)
    assert np.mean(inner(result.reasons) == 0) > 0.8
    assert result.geometry.doffs == doffs
    # The network's right view is moved by doffs; the one that goes with the maps is not.
    np.testing.assert_array_equal(np.stack(estimator.rectify(left, right)), np.stack([left, right]))


def test_rectify_gives_pictures_under_the_maps(pair):
    estimator = DepthEstimator(TINY_MODEL, calibration=raw_rig(), network_size=(80, 48))
    result = estimator.predict(*pair)
    left, right = estimator.rectify(*pair)
    assert left.shape == right.shape == (*result.disparity.shape, 3)
    full = DepthEstimator(TINY_MODEL, calibration=raw_rig(), network_size=(WIDTH, HEIGHT))
    full.predict(*pair)
    np.testing.assert_array_equal(np.stack([left, right]), np.stack(full.rectified_pair()))
    assert DepthEstimator(TINY_MODEL).rectify(*pair)[0] == pytest.approx(pair[0])
    with pytest.raises(errors.CalibrationSizeMismatch):
        estimator.rectify(*shifted_pair(64, 128, 4))
    assert estimator.rectified_pair()[0].shape == (48, 80, 3)


def test_results_are_compared_by_identity(pair):
    estimator = DepthEstimator(TINY_MODEL)
    first, second = estimator.predict(*pair), estimator.predict(*pair)
    assert first in [second, first]
    assert len({first, second, first}) == 2


def test_depth_range_limits_the_answer(pair):
    far = DepthEstimator(TINY_MODEL, calibration=rectified_rig(), depth_range_mm=(90.0, 200.0)).predict(*pair)
    assert np.all((inner(far.reasons) & Reason.OUT_OF_RANGE) != 0)
    assert np.all(np.isnan(inner(far.depth)))
    assert far.status is not Status.OK


def out_of_range(model, disparity, network_size=None):
    """Share of the pixels, beyond the band that the right camera does not see, that are said to be out of range."""
    estimator = DepthEstimator(model, network_size=network_size, min_confidence=0.0)
    reasons = estimator.predict(*shifted_pair(120, 240, disparity)).reasons[:, 80:]
    return np.mean((reasons & Reason.OUT_OF_RANGE) != 0)


def test_surfaces_nearer_than_the_max_candidate_disparity_are_out_of_range():
    assert out_of_range(TINY_MODEL, 29) < 0.05
    assert out_of_range(TINY_MODEL, 31) > 0.5
    # At half the size the network's 31 px are 62 px of the frame.
    assert out_of_range(TINY_MODEL, 31, (120, 60)) < 0.05
    assert out_of_range(TINY_MODEL, 62, (120, 60)) > 0.5


def test_a_model_that_does_not_state_its_max_candidate_disparity_answers_up_to_it():
    stated = b"endosdk.max_candidate_disparity"
    data = TINY_MODEL.read_bytes()
    assert data.count(stated) == 1
    silent = data.replace(stated, b"another.max_candidate_disparity")
    silent = silent.replace(_core.seal_key.encode(), b"another.content_sha256")
    assert DepthEstimator(silent).model.max_candidate_disparity is None
    assert out_of_range(silent, 31) < 0.05


def test_diagnostics_identify_everything(pair):
    rig = rectified_rig()
    estimator = DepthEstimator(TINY_MODEL, calibration=rig, threads=1)
    result = estimator.predict(*pair)
    report = estimator.diagnostics()
    assert report["model"]["sha256"] == result.model.sha256
    assert report["calibration_sha256"] == rig.sha256 == result.calibration_sha256
    assert report["provider"] == "CPUExecutionProvider"
    assert report["onnxruntime_telemetry"] == "off"
    assert report["frames"] == 1
    stages = report["mean_ms"]
    assert [stages[name] for name in ("rectify", "session", "postprocess")] == pytest.approx(
        [result.timings.rectify_ms, result.timings.session_ms, result.timings.postprocess_ms]
    )
    assert 0 < stages["trust"] < result.timings.total_ms
