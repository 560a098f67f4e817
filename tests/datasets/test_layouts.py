"""Readers of public data sets, on tiny files in the true formats."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk.datasets.layouts import READERS, default_split, open_dataset
from endosdk.datasets.layouts.pfm import read_pfm
from endosdk.errors import DatasetInvalid, InvalidArgument

HEIGHT, WIDTH = 24, 40


def views(seed=0, height=HEIGHT, width=WIDTH):
    """RGB left and right, with unequal channels, so that a swapped order shows."""
    rng = np.random.default_rng(seed)
    left = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    left[..., 0] //= 4
    return left, np.roll(left, -3, axis=1)


def save(path: Path, rgb_or_gray):
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = rgb_or_gray[..., ::-1] if rgb_or_gray.ndim == 3 else rgb_or_gray
    assert cv2.imwrite(str(path), np.ascontiguousarray(picture))


def save_text(path: Path, text: str):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def truth_map():
    """3.25 px, with a column that has no truth."""
    disparity = np.full((HEIGHT, WIDTH), 3.25, np.float32)
    disparity[:, 5] = np.nan
    return disparity


def as_16bit(disparity):
    return np.round(np.nan_to_num(disparity) * 256).astype(np.uint16)


def save_pfm(path: Path, values, order="<"):
    data = values[::-1].astype(f"{order}f4").tobytes()
    path.write_bytes(f"Pf\n{values.shape[1]} {values.shape[0]}\n{-1 if order == '<' else 1}.0\n".encode() + data)


# plain


@pytest.mark.parametrize("below", ["", "mix"])
def test_a_set_of_ours_is_no_plain_folder(below, tmp_path):
    for split in ("train", "test"):
        save(tmp_path / below / split / "0/disparity.png", as_16bit(truth_map()))
    save_text(tmp_path / below / "dataset.json", "{}")
    with pytest.raises(DatasetInvalid, match=r"must hold no dataset\.json: .* layout endosdk, not plain; got .*\.json"):
        open_dataset(tmp_path, "train", layout="plain")


# KITTI


def write_kitti(root: Path, edition: str):
    left, right = views()
    names = {
        "2015": ("image_2", "image_3", "disp_occ_0", "disp_noc_0", "calib_cam_to_cam", "P_rect_02", "P_rect_03"),
        "2012": ("colored_0", "colored_1", "disp_occ", "disp_noc", "calib", "P2", "P3"),
        "2012 gray": ("image_0", "image_1", "disp_occ", "disp_noc", "calib", "P0", "P1"),
    }[edition]
    base = root / "training"
    if edition == "2012 gray":
        left, right = left[..., 1], right[..., 1]
    save(base / names[0] / "000003_10.png", left)
    save(base / names[0] / "000003_11.png", left)
    save(base / names[1] / "000003_10.png", right)
    truth = truth_map()
    save(base / names[2] / "000003_10.png", as_16bit(truth))
    truth[:, :4] = np.nan
    save(base / names[3] / "000003_10.png", as_16bit(truth))
    text = f"{names[5]}: 721.5 0 609.5 44.85 0 721.5 172.8 0.2 0 0 1 0.003\n"
    text += f"{names[6]}: 721.5 0 609.5 -339.5 0 721.5 172.8 2.2 0 0 1 0.003\n"
    save_text(base / names[4] / "000003.txt", "calib_time: 09-Jan-2012 13:57:47\n" + text)


@pytest.mark.parametrize("edition", ["2012", "2012 gray", "2015"])
def test_kitti_gives_truth_occlusion_and_metric_camera(tmp_path, edition):
    write_kitti(tmp_path, edition)
    reader = open_dataset(tmp_path, "train", layout="kitti")
    assert reader.ids == ("000003_10",)
    sample = reader[0]
    if edition == "2012 gray":
        assert np.array_equal(sample.left[..., 0], views()[0][..., 1])
    else:
        assert np.array_equal(sample.left, views()[0])
        assert np.array_equal(sample.right, views()[1])
    assert np.array_equal(sample.disparity, truth_map(), equal_nan=True)
    assert sample.occlusion is not None
    assert sample.occlusion[:, :4].all() and not sample.occlusion[:, 4:].any()
    assert sample.focal_px == 721.5
    assert sample.baseline_mm == pytest.approx(1000 * (44.85 + 339.5) / 721.5)


def test_kitti_has_no_truth_for_its_test_split(tmp_path):
    write_kitti(tmp_path, "2015")
    with pytest.raises(InvalidArgument, match="truth for no other"):
        open_dataset(tmp_path, "test", layout="kitti")


def test_kitti_calibration_without_projection_is_named(tmp_path):
    write_kitti(tmp_path, "2015")
    save_text(tmp_path / "training/calib_cam_to_cam/000003.txt", "P_rect_02: 1 2 3\n")
    with pytest.raises(DatasetInvalid, match=r"000003\.txt must hold the twelve numbers of P_rect_02"):
        open_dataset(tmp_path, "train", layout="kitti")[0]


# SERV-CT


def write_servct(root: Path, reference="Reference_CT", numbers=None):
    left, right = views()
    base = root / "Experiment_1"
    save(base / "Left_rectified/001.png", left)
    save(base / "Right_rectified/001.png", right)
    save(base / reference / "Disparity/001.png", as_16bit(truth_map()))
    colours = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    colours[0], colours[1], colours[2] = (255, 0, 0), (255, 255, 0), (0, 0, 255)
    save(base / reference / "OcclusionL/001.png", colours)
    first = [[1035.3, 0, 596.9, 0], [0, 1035.3, 520.4, 0], [0, 0, 1, 0]]
    second = [[1035.3, 0, 598.9, -1035.3 * 4.2], [0, 1035.3, 520.4, 0], [0, 0, 1, 0]]
    if numbers is None:
        head = {"type_id": "opencv-matrix", "rows": 3, "cols": 4, "dt": "d"}
        numbers = {key: {**head, "data": np.ravel(rows).tolist()} for key, rows in (("P1", first), ("P2", second))}
    save_text(base / "Rectified_calibration/001.json", json.dumps(numbers))


@pytest.mark.parametrize("reference", ["Reference_CT", "Ground_truth_CT"])
def test_servct_reads_the_coloured_occlusion_and_the_projections(tmp_path, reference):
    write_servct(tmp_path, reference)
    sample = open_dataset(tmp_path, "test", layout="servct")[0]
    assert sample.id == "Experiment_1/001"
    assert np.array_equal(sample.left, views()[0])
    expected = truth_map()
    expected[2] = np.nan  # blue: outside the scanned surface
    assert np.array_equal(sample.disparity, expected, equal_nan=True)
    assert sample.occlusion is not None
    assert sample.occlusion[:2].all() and not sample.occlusion[2:].any()
    assert (sample.focal_px, sample.baseline_mm, sample.doffs) == pytest.approx((1035.3, 4.2, 2.0))


def test_servct_calibration_without_p2_is_named(tmp_path):
    write_servct(tmp_path, numbers={"P1": np.eye(3, 4).tolist()})
    with pytest.raises(DatasetInvalid, match=r"001\.json must be JSON with the projections P1 and P2"):
        open_dataset(tmp_path, "test", layout="servct")[0]


def test_servct_experiment_without_reference_is_named(tmp_path):
    write_servct(tmp_path, "Reference_RGB")
    with pytest.raises(DatasetInvalid, match="Experiment_1 must hold Reference_CT or Ground_truth_CT"):
        open_dataset(tmp_path, "test", layout="servct")


# Middlebury

CALIB = """cam0=[3997.684 0 1176.728; 0 3997.684 1011.728; 0 0 1]
cam1=[3997.684 0 1307.839; 0 3997.684 1011.728; 0 0 1]
doffs=131.111
baseline=193.001
width=40
height=24
ndisp=280
isint=0
"""


def write_middlebury(scene: Path, kind: str):
    left, right = views()
    save(scene / "im0.png", left)
    save(scene / "im1.png", right)
    save_text(scene / "calib.txt", CALIB)
    truth = np.where(np.isnan(truth_map()), np.inf, truth_map())
    if kind == "evaluation":
        save_pfm(scene / "disp0GT.pfm", truth)
        mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
        mask[:, :4], mask[:, 5] = 128, 0
        save(scene / "mask0nocc.png", mask)
    else:
        save_pfm(scene / "disp0.pfm", truth)
        save_pfm(scene / "disp1.pfm", np.full((HEIGHT, WIDTH), 3.25, np.float32))


@pytest.mark.parametrize("kind", ["evaluation", "2014", "2021"])
def test_middlebury_reads_pfm_and_the_offset_of_the_principal_points(tmp_path, kind):
    scene = {"evaluation": "trainingQ/Adirondack", "2014": "Backpack-perfect", "2021": "artroom1"}[kind]
    write_middlebury(tmp_path / scene, kind)
    reader = open_dataset(tmp_path, "train", layout="middlebury")
    assert reader.ids == (scene,)
    sample = reader[0]
    assert np.array_equal(sample.right, views()[1])
    assert np.array_equal(sample.disparity, truth_map(), equal_nan=True)
    assert (sample.focal_px, sample.baseline_mm, sample.doffs) == (3997.684, 193.001, 131.111)
    assert sample.occlusion is not None
    known = np.isfinite(sample.disparity)
    assert sample.occlusion[:, :3].all() and not (sample.occlusion & known)[:, 6:].any()
    assert (sample.disparity_right is None) == (kind == "evaluation")


def test_a_hole_in_the_right_truth_of_middlebury_hides_nothing(tmp_path):
    write_middlebury(tmp_path / "artroom1", "2021")
    other = np.full((HEIGHT, WIDTH), 3.25, np.float32)
    other[:, 18:24] = np.inf  # nobody knows
    other[:, 30:33] = 9.0  # something near stands there
    save_pfm(tmp_path / "artroom1/disp1.pfm", other)
    sample = open_dataset(tmp_path, "train", layout="middlebury")[0]
    hidden = sample.occlusion & (np.abs(sample.disparity - 3.25) < 0.5)
    assert not hidden[:, 20:28].any() and hidden[:, 34:36].any()


@pytest.mark.parametrize(("layout", "write"), [("middlebury", "2021"), ("plain", True)])
def test_one_scene_is_a_set_wherever_the_command_runs(tmp_path, monkeypatch, layout, write):
    scene = tmp_path / "artroom1"
    (write_middlebury if layout == "middlebury" else write_plain)(scene, write)
    monkeypatch.chdir(scene)
    for root in (scene, "."):
        reader = open_dataset(root, default_split(layout), layout=layout)
        assert (reader.name, reader.ids) == (f"{layout}:artroom1", ("artroom1",))


@pytest.mark.parametrize("order", ["<", ">"])
def test_pfm_of_either_byte_order_has_its_top_row_first(tmp_path, order):
    values = np.arange(6, dtype=np.float32).reshape(2, 3)
    save_pfm(tmp_path / "a.pfm", values, order)
    assert np.array_equal(read_pfm(tmp_path / "a.pfm"), values)


def test_pfm_that_is_cut_short_or_coloured_is_refused(tmp_path):
    save_pfm(tmp_path / "a.pfm", np.zeros((2, 3), np.float32))
    data = (tmp_path / "a.pfm").read_bytes()
    (tmp_path / "short.pfm").write_bytes(data[:-1])
    (tmp_path / "colour.pfm").write_bytes(b"PF" + data[2:])
    for name, rule in (("short", "must hold 2 x 3 numbers"), ("colour", "of one channel"), ("none", "that exists")):
        with pytest.raises(DatasetInvalid, match=rule):
            read_pfm(tmp_path / f"{name}.pfm")


@pytest.mark.parametrize("scale", ["-1.0.5", "-.", "1..", "--1", "1e"])
def test_a_pfm_whose_scale_is_no_number_is_refused(tmp_path, scale):
    (tmp_path / "a.pfm").write_bytes(f"Pf\n3 2\n{scale}\n".encode() + bytes(24))
    with pytest.raises(DatasetInvalid, match="of one channel"):
        read_pfm(tmp_path / "a.pfm")


@pytest.mark.parametrize("scale", ["-1", "-1.", "-.5", "-1.25e-2"])
def test_every_way_to_write_the_scale_of_a_pfm_is_read(tmp_path, scale):
    (tmp_path / "a.pfm").write_bytes(f"Pf\n3 2\n{scale}\n".encode() + np.ones((2, 3), "<f4").tobytes())
    assert np.array_equal(read_pfm(tmp_path / "a.pfm"), np.ones((2, 3)))


# SCARED: a plane seen by two turned, distorted cameras

SIZE = (96, 64)
TURN = cv2.Rodrigues(np.array([0.01, -0.02, 0.015]))[0]
SHIFT = np.array([-4.2, 0.05, 0.03])
LEFT = np.array([[90.0, 0, 47.0], [0, 90.0, 31.0], [0, 0, 1]])
RIGHT = np.array([[91.0, 0, 49.0], [0, 91.0, 32.0], [0, 0, 1]])
BEND = np.array([0.05, -0.02, 0.001, -0.001, 0.0])
NORMAL, AWAY = np.array([0.1, -0.2, 1.0]), 60.0  # the plane NORMAL . p = AWAY, mm


def points_of(matrix):
    """x, y, z [H, W, 3] that a distorted camera at the origin sees of the plane."""
    grid = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), -1).reshape(-1, 1, 2).astype(np.float64)
    limits = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-12)
    rays = cv2.undistortPoints(grid, matrix, BEND, criteria=limits)
    rays = np.concatenate([rays[:, 0], np.ones((len(grid), 1))], axis=1)
    points = rays * (AWAY / (rays @ NORMAL))[:, None]
    return points.reshape(SIZE[1], SIZE[0], 3).astype(np.float32)


def write_scared(folder: Path, stacked=False):
    left, right = views(3, SIZE[1], SIZE[0])
    points = points_of(LEFT)
    points[20:24, 30:34] = np.nan  # the structured light gave nothing
    if stacked:
        (folder / "data/scene_points").mkdir(parents=True)
        both = np.concatenate([points, points])
        assert cv2.imwrite(str(folder / "data/scene_points/scene_points000001.tiff"), both[..., ::-1])
        video = cv2.VideoWriter(
            str(folder / "data/rgb.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 25, (SIZE[0], 2 * SIZE[1])
        )
        for level in (40, 200):  # frame 0 dark, frame 1 bright above, dim below
            frame = np.full((2 * SIZE[1], SIZE[0], 3), level, np.uint8)
            frame[SIZE[1] :] //= 2
            video.write(frame)
        video.release()
    else:
        save(folder / "Left_Image.png", left)
        save(folder / "Right_Image.png", right)
        assert cv2.imwrite(str(folder / "left_depth_map.tiff"), points[..., ::-1])
    storage = cv2.FileStorage(str(folder / "endoscope_calibration.yaml"), cv2.FILE_STORAGE_WRITE)
    for name, value in (("R", TURN), ("T", SHIFT), ("M1", LEFT), ("D1", BEND), ("M2", RIGHT), ("D2", BEND)):
        storage.write(name, value)
    storage.release()


def expected_scared_disparity(sample):
    """Of the plane, computed in the rectified camera by OpenCV alone."""
    turn, _, first, second, *_ = cv2.stereoRectify(
        LEFT, BEND, RIGHT, BEND, SIZE, TURN, SHIFT.reshape(3, 1), flags=cv2.CALIB_ZERO_DISPARITY, alpha=0
    )
    focal, baseline = first[0, 0], -second[0, 3] / second[0, 0]
    assert (sample.focal_px, sample.baseline_mm) == pytest.approx((focal, baseline))
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack([(x - first[0, 2]) / focal, (y - first[1, 2]) / focal, np.ones(x.shape)], -1)
    depth = AWAY / (rays @ (turn @ NORMAL))
    return focal * baseline / depth


def test_scared_test_sets_have_the_names_of_the_challenge(tmp_path):
    write_scared(tmp_path / "test_dataset_8/keyframe_1")
    assert open_dataset(tmp_path, "test", layout="scared").ids == ("test_dataset_8/keyframe_1",)
    with pytest.raises(DatasetInvalid, match=r"split train: dataset_N/keyframe_M/left_depth_map\.tiff"):
        open_dataset(tmp_path, "train", layout="scared")


@pytest.mark.parametrize("layout", ["endosdk", *READERS])
def test_a_folder_that_is_not_there_is_not_an_empty_one(layout, tmp_path):
    missing = tmp_path / "none"
    with pytest.raises(DatasetInvalid, match=r"dataset: must be a folder that is there; got .*none"):
        open_dataset(missing, default_split(layout), layout=layout)
    missing.mkdir()
    pattern = READERS[layout].pattern if layout in READERS else "dataset.json"
    with pytest.raises(DatasetInvalid, match=f"must hold .*{re.escape(pattern)}"):
        open_dataset(missing, default_split(layout), layout=layout)


def test_scared_truth_is_that_of_the_rectified_view(tmp_path):
    write_scared(tmp_path / "dataset_8/keyframe_1")
    sample = open_dataset(tmp_path, "test", layout="scared")[0]
    assert sample.id == "dataset_8/keyframe_1"
    known = np.isfinite(sample.disparity)
    assert 0.95 < known.mean() < 1  # the hole is still one
    difference = np.abs(sample.disparity - expected_scared_disparity(sample))[known]
    # Beside the hole the nearest pixel is taken, half a pixel off on the slanted plane.
    assert difference.max() < 1e-2
    assert np.median(difference) < 1e-5


def test_scared_video_frames_are_the_upper_and_lower_half(tmp_path):
    write_scared(tmp_path / "dataset_8/keyframe_2", stacked=True)
    sample = open_dataset(tmp_path, "test", layout="scared")[0]
    assert sample.id == "dataset_8/keyframe_2/000001"
    middle = np.s_[20:40, 30:60]
    assert abs(float(sample.left[middle].mean()) - 200) < 12
    assert abs(float(sample.right[middle].mean()) - 100) < 12
    known = np.isfinite(sample.disparity)
    assert np.abs(sample.disparity - expected_scared_disparity(sample))[known].max() < 1e-2


def test_scared_sets_one_to_seven_are_for_training(tmp_path):
    write_scared(tmp_path / "dataset_3/keyframe_1")
    assert open_dataset(tmp_path, "train", layout="scared").ids == ("dataset_3/keyframe_1",)
    with pytest.raises(DatasetInvalid, match="must hold samples in the layout scared, split test"):
        open_dataset(tmp_path, "test", layout="scared")


@pytest.mark.parametrize("name", ["dataset_10", "dataset_0", "my_dataset"])
def test_a_set_that_scared_does_not_have_is_neither_for_training_nor_for_testing(tmp_path, name):
    write_scared(tmp_path / name / "keyframe_1")
    for split in ("train", "test"):
        with pytest.raises(DatasetInvalid, match=rf"dataset_1 to dataset_7 for train.*{name}"):
            open_dataset(tmp_path, split, layout="scared")


def test_scared_names_may_go_on_behind_the_number(tmp_path):
    write_scared(tmp_path / "dataset_8_v2/keyframe_1")
    assert open_dataset(tmp_path, "test", layout="scared").ids == ("dataset_8_v2/keyframe_1",)


def test_scared_points_may_lie_where_their_archive_was_unpacked(tmp_path):
    write_scared(tmp_path / "dataset_8/keyframe_2", stacked=True)
    data = tmp_path / "dataset_8/keyframe_2/data"
    for points in (data / "scene_points").iterdir():
        points.rename(data / points.name)
    assert open_dataset(tmp_path, "test", layout="scared").ids == ("dataset_8/keyframe_2/000001",)


def test_scared_truth_that_is_no_point_map_is_named(tmp_path):
    write_scared(tmp_path / "dataset_3/keyframe_1")
    assert cv2.imwrite(str(tmp_path / "dataset_3/keyframe_1/left_depth_map.tiff"), np.zeros((64, 96), np.float32))
    with pytest.raises(DatasetInvalid, match=r"left_depth_map\.tiff must be a float32 picture of x, y, z"):
        open_dataset(tmp_path, "train", layout="scared")[0]


# all of them

WRITERS = {
    "kitti": lambda root: write_kitti(root, "2015"),
    "servct": write_servct,
    "middlebury": lambda root: write_middlebury(root, "2021"),
    "plain": lambda root: write_plain(root),
}


def kitti_rows(focal=721.5, shift=-339.5):
    first, second = (f"{focal} 0 609.5 {x} 0 {focal} 172.8 0 0 0 1 0\n" for x in (44.85, shift))
    return f"P_rect_02: {first}P_rect_03: {second}"


def servct_json(focal=1035.3, shift=-4348.0, first=596.9, second=598.9):
    rows = [[[focal, 0, x, t], [0, focal, 520.4, 0], [0, 0, 1, 0]] for x, t in ((first, 0), (second, shift))]
    return json.dumps({"P1": rows[0], "P2": rows[1]})


CALIBRATIONS = {
    "kitti": "training/calib_cam_to_cam/000003.txt",
    "servct": "Experiment_1/Rectified_calibration/001.json",
    "middlebury": "calib.txt",
}


@pytest.mark.parametrize(
    ("layout", "text", "rule"),
    [
        ("kitti", kitti_rows(focal=0), "the focal length of .* must be finite and above 0; got 0.0"),
        ("kitti", kitti_rows(focal="nan"), "the focal length of .* must be finite and above 0; got nan"),
        ("kitti", kitti_rows(shift=44.85), "the baseline of .* must be finite and above 0; got 0.0"),
        ("servct", servct_json(focal=0), "the focal length of .* must be finite and above 0; got 0.0"),
        ("servct", servct_json(shift=4348.0), "the baseline of .* must be finite and above 0; got -4"),
        ("servct", servct_json(first=-1e308, second=1e308), "principal points of .* must be finite; got inf"),
        ("middlebury", CALIB.replace("[3997.684", "[-1"), "the focal length of .* must be finite and above 0; got -1"),
        ("middlebury", CALIB.replace("193.001", "inf"), "the baseline of .* must be finite and above 0; got inf"),
        ("middlebury", CALIB.replace("131.111", "nan"), "the doffs of .* must be finite; got nan"),
    ],
)
def test_an_impossible_calibration_is_named(tmp_path, layout, text, rule):
    WRITERS[layout](tmp_path)
    save_text(tmp_path / CALIBRATIONS[layout], text)
    with pytest.raises(DatasetInvalid, match=rule) as found:
        open_dataset(tmp_path, default_split(layout), layout=layout)[0]
    assert Path(CALIBRATIONS[layout]).name in str(found.value)


SMALL = np.full((HEIGHT - 2, WIDTH), 128, np.uint8)


@pytest.mark.parametrize(
    ("layout", "file", "damage"),
    [
        ("kitti", "training/disp_noc_0/000003_10.png", lambda path: save(path, SMALL.astype(np.uint16))),
        ("servct", "Experiment_1/Reference_CT/OcclusionL/001.png", lambda path: save(path, SMALL)),
        ("middlebury", "disp1.pfm", lambda path: save_pfm(path, SMALL.astype(np.float32) / 64)),
        ("middlebury", "mask0nocc.png", lambda path: save(path, SMALL)),
    ],
)
def test_a_map_of_another_size_than_the_truth_is_named(tmp_path, layout, file, damage):
    WRITERS[layout](tmp_path)
    damage(tmp_path / file)
    rule = rf"{Path(file).name} must be as large as the truth \(24, 40\); got \(22, 40\)"
    with pytest.raises(DatasetInvalid, match=rule):
        open_dataset(tmp_path, default_split(layout), layout=layout)[0]


@pytest.mark.parametrize(
    ("layout", "file"),
    [
        ("kitti", "training/disp_occ_0/000003_10.png"),
        ("servct", "Experiment_1/Reference_CT/Disparity/001.png"),
        ("middlebury", "disp0.pfm"),
        ("middlebury", "disp1.pfm"),
        ("plain", "disparity.png"),
    ],
)
def test_truth_beyond_the_frame_is_named(tmp_path, layout, file):
    WRITERS[layout](tmp_path)
    truth = np.nan_to_num(truth_map())
    truth[2, 3] = WIDTH + 0.25
    if file.endswith(".pfm"):
        save_pfm(tmp_path / file, truth)
    else:
        save(tmp_path / file, as_16bit(truth))
    rule = rf"{Path(file).name} must hold at most the frame's width, 40 px; got 40.25"
    with pytest.raises(DatasetInvalid, match=rule):
        open_dataset(tmp_path, default_split(layout), layout=layout)[0]


def test_middlebury_truth_that_is_no_number_is_named(tmp_path):
    write_middlebury(tmp_path, "2021")
    save_pfm(tmp_path / "disp0.pfm", truth_map())
    with pytest.raises(DatasetInvalid, match=r"disp0\.pfm must hold numbers, or inf where there is no truth; got nan"):
        open_dataset(tmp_path, "train", layout="middlebury")[0]


def test_unknown_layout_and_views_of_unequal_size_are_refused(tmp_path):
    with pytest.raises(
        InvalidArgument, match="layout: must be one of endosdk, kitti, middlebury, plain, scared, servct"
    ):
        open_dataset(tmp_path, "train", layout="nuscenes")
    write_kitti(tmp_path, "2015")
    save(tmp_path / "training/image_3/000003_10.png", views()[1][:-2])
    with pytest.raises(DatasetInvalid, match="the right view must be as large as the left"):
        open_dataset(tmp_path, "train", layout="kitti")[0]


def test_hash_follows_the_contents(tmp_path):
    write_kitti(tmp_path, "2015")
    before = open_dataset(tmp_path, "train", layout="kitti").sha256
    assert open_dataset(tmp_path, "train", layout="kitti").sha256 == before
    save(tmp_path / "training/image_2/000003_10.png", views(7)[0])
    assert open_dataset(tmp_path, "train", layout="kitti").sha256 != before


def test_usual_split_is_the_one_with_truth():
    assert [default_split(name) for name in ("endosdk", "kitti", "middlebury", "scared", "servct")] == [
        "test",
        "train",
        "train",
        "test",
        "test",
    ]


# Plain folders


def write_plain(folder: Path, mask=True):
    left, right = views()
    save(folder / "left.png", left)
    save(folder / "right.png", right)
    save(folder / "disparity.png", as_16bit(truth_map()))
    if mask:
        seen = np.full((HEIGHT, WIDTH), 255, np.uint8)
        seen[:, :4] = 0
        save(folder / "nonoccluded.png", seen)


@pytest.mark.parametrize("mask", [True, False])
def test_plain_folders_give_truth_and_no_camera(tmp_path, mask):
    write_plain(tmp_path / "Aloe", mask)
    write_plain(tmp_path / "Baby1", mask)
    reader = open_dataset(tmp_path, default_split("plain"), layout="plain")
    assert reader.ids == open_dataset(tmp_path, "train", layout="plain").ids == ("Aloe", "Baby1")
    sample = reader[0]
    assert np.array_equal(sample.left, views()[0]) and np.array_equal(sample.right, views()[1])
    assert np.array_equal(sample.disparity, truth_map(), equal_nan=True)
    assert not sample.has_camera
    if mask:
        assert sample.occlusion[:, :4].all() and not sample.occlusion[:, 4:].any()
    else:
        assert sample.occlusion is None


@pytest.mark.parametrize("file", ["left.png", "right.png", "nonoccluded.png"])
def test_a_view_of_16_bits_is_named_and_not_cut_to_8(tmp_path, file):
    write_plain(tmp_path / "Aloe")
    shape = (HEIGHT, WIDTH) if file == "nonoccluded.png" else (HEIGHT, WIDTH, 3)
    save(tmp_path / "Aloe" / file, np.full(shape, 4095, np.uint16))
    with pytest.raises(DatasetInvalid, match=rf"{file} must have 8 bits per channel; got uint16"):
        open_dataset(tmp_path, "test", layout="plain")[0]


def test_a_plain_mask_of_another_size_is_named(tmp_path):
    write_plain(tmp_path / "Aloe")
    save(tmp_path / "Aloe/nonoccluded.png", np.zeros((3, 4), np.uint8))
    with pytest.raises(DatasetInvalid, match=r"nonoccluded\.png must be as large as the truth"):
        open_dataset(tmp_path, "test", layout="plain")[0]
