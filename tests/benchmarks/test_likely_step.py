"""The benchmark of the sub-pixel correction compares the same weights, and leaves the damping as it was."""

from benchmarks.studies.likely_step import measure
from endosdk.datasets.layouts import open_dataset
from endosdk.training.networks import photometric
from tests.training.warped_set import write_warped_set


def test_the_pictures_bring_the_coarse_map_nearer_to_the_truth(tmp_path):
    write_warped_set(tmp_path, 0, 2, (184, 320), (3.0, 40.0))
    shipped = photometric.DOUBT
    found = measure("wang2020", open_dataset(tmp_path, "test"), range(2), [0.5])
    assert list(found) == ["alone", "corrected, damping 0.5"]
    alone, corrected = (errors["epe_px"] for errors in found.values())
    assert corrected < 0.97 * alone
    assert photometric.DOUBT == shipped
