"""The benchmark of joint bilateral upsampling compares the same answers, and sees what guiding is for."""

import pytest

from benchmarks.studies.upsampling import measure
from endosdk.datasets.layouts import open_dataset
from tests.training.exported_networks import Exported, shared_folder
from tests.training.warped_set import write_warped_set


@pytest.fixture(scope="module")
def layers(tmp_path_factory):
    """Textured layers with edges between them."""
    root = tmp_path_factory.mktemp("layers")
    write_warped_set(root, 0, 2, (184, 320), (3.0, 40.0))
    return open_dataset(root, "test")


def test_joint_bilateral_edges_are_nearer_to_the_truth(layers):
    found = measure("fast-fp32", layers, 2)
    assert found["pairs"] == 2
    assert found["joint_bilateral"]["epe_px"] < found["bilinear"]["epe_px"]


def test_an_answer_as_large_as_the_input_is_left_alone(layers):
    path = Exported(shared_folder(), "wang2020").path  # every shipped model answers for cells of more than one pixel
    found = measure(str(path), layers, 1)
    assert found["joint_bilateral"] == pytest.approx(found["bilinear"], rel=1e-5)
