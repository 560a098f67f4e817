import torch

from endosdk.datasets.layouts import open_dataset
from endosdk.training.data import Crops
from endosdk.training.fit_confidence import fit_confidence
from endosdk.training.networks import build_network, fast
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


def test_weights_from_before_there_were_clues_keep_their_confidence():
    torch.manual_seed(0)
    for name in ("fast", "cascade"):
        network = build_network(name, max_disparity=64).eval()
        network.confidence.weights[1:-1] = torch.linspace(0.1, 0.5, len(network.confidence.weights) - 2)
        old = {key: value for key, value in network.state_dict().items() if ".surveyor." not in key}
        for key in [key for key in old if key.endswith("confidence.weights")]:
            old[key] = old[key][:-1]
        views = torch.rand(2, 1, 3, 64, 96) * 255
        with torch.inference_mode():
            expected = network.trust(network(*views))
            network.load_state_dict(network.adapted(old, 64, None))
            assert torch.equal(network.trust(network(*views)), expected)


def test_weights_from_before_there_were_surfaces_keep_their_answers():
    torch.manual_seed(0)
    network = build_network("fast", max_disparity=64).eval()
    views = torch.rand(2, 1, 3, 64, 96) * 255
    gates = slice(2 * fast.FINE**2, None)
    with torch.inference_mode():
        for name, axis in fast.GROWN.items():
            new = network.state_dict()[name].narrow(axis, -8, 8)  # as many hints as outputs of the gates
            new.fill_(1.0 if name.endswith("spread") else 0.0)
        network.refinement.last.bias[gates] = -50.0
        expected = network(*views)
        old = dict(network.state_dict())
        old |= {name: old[name].narrow(axis, 0, old[name].shape[axis] - 8).clone() for name, axis in fast.GROWN.items()}
        grown = build_network("fast", max_disparity=64).eval()
        grown.load_state_dict(grown.adapted(old, 64, None))
        assert torch.equal(grown.refinement.last.bias[gates], torch.full((8,), fast.START[2]))
        grown.refinement.last.bias[gates] = -50.0
        assert torch.equal(grown(*views).disparities[1], expected.disparities[1])
        assert torch.equal(grown.trust(grown(*views)), grown.trust(expected))
