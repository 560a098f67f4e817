import numpy as np
import pytest
import torch

from endosdk.datasets.layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.training.fit_confidence import fit_confidence, fit_laplace
from endosdk.training.networks import build_network
from endosdk.training.networks.confidence import ConfidenceHead


def laplace_errors(seed=0, count=60_000):
    """Errors whose scale is known: log b = -1 + 0.7 e1 - 0.3 e2."""
    rng = np.random.default_rng(seed)
    evidence = rng.normal([2.0, -5.0], [1.5, 0.2], size=(count, 2))
    scale = np.exp(-1.0 + 0.7 * evidence[:, 0] - 0.3 * evidence[:, 1])
    return torch.from_numpy(evidence).float(), torch.from_numpy(rng.laplace(0.0, scale)).float()


def test_the_fit_finds_the_law_that_made_the_errors():
    weights = fit_laplace(*laplace_errors())
    torch.testing.assert_close(weights, torch.tensor([-1.0, 0.7, -0.3]), atol=0.15, rtol=0)
    assert abs(weights[1].item() - 0.7) < 0.01


def test_the_fit_is_the_most_likely_one():
    evidence, error = laplace_errors(count=5000)

    def likelihood(weights):
        log_scale = weights[0] + evidence @ weights[1:]
        return (error.abs() / log_scale.exp() + log_scale).mean().item()

    best = fit_laplace(evidence, error)
    for change in torch.eye(3) * 0.05:
        assert likelihood(best) < min(likelihood(best + change), likelihood(best - change))


def test_confidence_is_the_share_of_errors_within_a_pixel():
    evidence, error = laplace_errors(seed=1)
    head = ConfidenceHead(2)
    head.weights.copy_(fit_laplace(evidence, error))
    confidence = head(head.scale_of(evidence.T[None, :, :, None])).flatten()
    within = (error.abs() <= 1.0).float()
    for low in (0.2, 0.4, 0.6, 0.8):
        bin_ = (confidence >= low) & (confidence < low + 0.2)
        assert bin_.sum() > 500
        assert confidence[bin_].mean().item() == pytest.approx(within[bin_].mean().item(), abs=0.03)


def test_extreme_evidence_keeps_confidence_inside_its_range():
    head = ConfidenceHead(1)
    confidence = head(head.scale_of(torch.tensor([-1e6, 0.0, 1e6]).reshape(1, 1, 1, 3)))
    assert torch.isfinite(confidence).all()
    assert 0.0 < confidence.min() < 0.011
    assert confidence.max() <= 1.0


def test_a_column_that_never_changes_does_no_harm():
    evidence, error = laplace_errors(count=2000)
    weights = fit_laplace(torch.cat([evidence, torch.ones(2000, 1)], dim=1), error)
    assert torch.isfinite(weights).all()


def test_bad_shapes_are_named():
    with pytest.raises(InvalidArgument, match="evidence"):
        fit_laplace(torch.zeros(3, 5), torch.zeros(3))
    with pytest.raises(InvalidArgument, match="evidence"):
        fit_laplace(torch.zeros(30, 2), torch.zeros(29))


def test_calibration_changes_the_confidence_of_a_network_and_nothing_else(dataset_root):
    torch.manual_seed(0)
    network = build_network("fast")
    before = {name: value.clone() for name, value in network.state_dict().items()}
    fit_confidence(network, open_dataset(dataset_root, "train"), [0, 1])
    changed = [name for name, value in network.state_dict().items() if not torch.equal(value, before[name])]
    assert changed == ["confidence.weights"]
    with pytest.raises(InvalidArgument, match="held_out"):
        fit_confidence(network, open_dataset(dataset_root, "train"), [])
