import torch

from endosdk.datasets.layouts import open_dataset
from endosdk.training.data import Crops
from endosdk.training.fit_confidence import fit_confidence
from endosdk.training.networks import build_network
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.survey import Known, learn, teach_surveyor


def errors_near_a_mark(seed):
    """Errors of 0.05 px, and of 5 px around cells that a clue marks; the evidence tells nothing."""
    draw = torch.Generator().manual_seed(seed)
    marks = (torch.rand(1, 1, 24, 24, generator=draw) < 0.01).float()
    near = torch.nn.functional.max_pool2d(marks, 5, 1, 2)[0]
    error = torch.randn(1, 24, 24, generator=draw) * torch.where(near > 0, 5.0, 0.05)
    return Known(torch.zeros(1, 1, 24, 24), marks, error, torch.ones_like(error)), near[0] > 0


def test_a_surveyor_learns_from_the_cells_around():
    torch.manual_seed(0)
    head = ConfidenceHead(1, clues=1)
    assert torch.equal(head.surveyor(torch.rand(1, 2, 8, 8)), torch.zeros(1, 1, 8, 8)), "until then it adds nothing"
    learn(head, [errors_near_a_mark(seed)[0] for seed in range(20)], steps=250, seed=0)
    unseen, near = errors_near_a_mark(99)
    with torch.no_grad():
        confidence = head(head.scale_of(head.columns(unseen.evidence, unseen.clues)))[0, 0]
    assert confidence[near].mean() < 0.4 and confidence[~near].mean() > 0.9
    assert not any(parameter.requires_grad for parameter in head.parameters())


def test_a_network_is_left_as_it_is_but_for_its_confidence(dataset_root):
    torch.manual_seed(0)
    network = build_network("fast")
    reader = open_dataset(dataset_root, "train")
    crops = Crops(reader, [0, 1], (64, 96), seed=1, inference_width=network.inference_width)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    teach_surveyor(network, crops, 4)
    fit_confidence(network, reader, [0, 1], spoilt=crops)
    changed = [name for name, value in network.state_dict().items() if not torch.equal(value, before[name])]
    assert "confidence.weights" in changed and "confidence.surveyor.last.weight" in changed
    assert all(name.startswith("confidence.") for name in changed)
