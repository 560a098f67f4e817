"""The benchmark of the sub-pixel correction compares the same weights, and leaves the damping as it was."""

from dataclasses import replace

from benchmarks.studies.likely_step import measure
from endosdk.datasets.layouts import open_dataset
from endosdk.training import checkpoint
from endosdk.training.networks import photometric
from tests.training.warped_set import write_warped_set


def test_the_pictures_bring_the_coarse_map_nearer_to_the_truth(tmp_path):
    write_warped_set(tmp_path, 0, 2, (184, 320), (3.0, 40.0))
    shipped = photometric.DOUBT
    # No weight depends on the range, and each plane of 8 px has layers of its own in a file.
    trained, weights = checkpoint.load(checkpoint.starting_point("wang2020")), tmp_path / "shorter.safetensors"
    checkpoint.save_weights(weights, replace(trained, config=replace(trained.config, max_disparity=40)))
    found = measure(str(weights), open_dataset(tmp_path, "test"), range(2), [0.5])
    assert list(found) == ["alone", "corrected, damping 0.5"]
    alone, corrected = (errors["epe_px"] for errors in found.values())
    assert corrected < 0.97 * alone
    assert photometric.DOUBT == shipped
