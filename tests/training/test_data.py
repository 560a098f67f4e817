from dataclasses import replace

import numpy as np
import pytest
import torch

from endosdk.datasets.layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.training.data import Crops, has_truth


@pytest.fixture
def reader(dataset_root):
    return open_dataset(dataset_root, "train")


def crops(reader, **changes):
    return Crops(reader, range(4), (64, 128), **{"seed": 1, **changes})


def test_an_item_is_a_function_of_seed_and_number(reader):
    first, again, other = crops(reader), crops(reader), crops(reader, seed=2)
    first[3]  # what was drawn before does not matter
    for a, b in zip(first[7], again[7], strict=True):
        assert torch.equal(a, b)
    assert not torch.equal(first[7][0], other[7][0])
    assert not torch.equal(first[7][0], first[8][0])


def test_items_have_the_types_and_shapes_that_training_expects(reader):
    left, right, truth = crops(reader)[0]
    assert left.shape == right.shape == (3, 64, 128)
    assert left.dtype == right.dtype == torch.uint8
    assert truth.shape == (1, 64, 128)
    assert truth.dtype == torch.float32


def test_an_epoch_visits_every_pair_once(reader):
    class Recorder:
        name, sha256 = reader.name, reader.sha256

        def __init__(self):
            self.seen = []

        def __getitem__(self, index):
            self.seen.append(index)
            return reader[index]

    recorder = Recorder()
    source = crops(recorder, cache_gib=0.0)
    for epoch in range(3):
        recorder.seen = []
        for item in range(epoch * 4, epoch * 4 + 4):
            source[item]
        assert sorted(recorder.seen) == [0, 1, 2, 3]


def test_the_cache_changes_nothing_but_the_reads(reader, monkeypatch):
    cached, uncached = crops(reader), crops(reader, cache_gib=0.0)
    assert all(torch.equal(a, b) for i in range(8) for a, b in zip(cached[i][:2], uncached[i][:2], strict=True))
    monkeypatch.setattr(type(reader), "__getitem__", lambda *_: pytest.fail("read again"))
    cached[9]


def test_cached_truth_is_that_of_the_file(reader):
    source = crops(reader, augment=False)
    truth = source[0][2].numpy()
    known = truth[np.isfinite(truth)]
    assert np.array_equal(known * 256, np.rint(known * 256))
    on_disk = [reader[i].disparity for i in range(4)]
    assert any(np.isin(known[:100], disparity).all() for disparity in on_disk)


def test_processes_share_the_work_without_overlap(reader):
    source = crops(reader, augment=False)
    options = {"first": 0, "last": 2, "workers": 0}
    alone = [left for left, *_ in source.batches(4, rank=0, world=1, **options)]
    halves = [list(source.batches(2, rank=rank, world=2, **options)) for rank in (0, 1)]
    for step in range(2):
        joined = torch.cat([halves[0][step][0], halves[1][step][0]])
        assert torch.equal(joined, alone[step])


@pytest.mark.parametrize("cache_gib, kept", [(8.0, 4), (0.0, 0)])
def test_workers_share_the_pairs_that_were_decoded_before_they_started(reader, cache_gib, kept):
    steps = {"first": 0, "last": 2, "rank": 0, "world": 1}
    alone = [left for left, *_ in crops(reader, augment=False).batches(2, workers=0, **steps)]
    source = crops(reader, augment=False, cache_gib=cache_gib)
    shared = [left for left, *_ in source.batches(2, workers=2, **steps)]
    assert all(torch.equal(*pair) for pair in zip(alone, shared, strict=True))
    assert len(source._cache) == kept  # in this process, which draws no crop itself


@pytest.mark.parametrize("workers", [0, 1])
def test_what_is_wrong_with_a_sample_is_told_as_it_is_by_workers_too(reader, monkeypatch, workers):
    source = crops(reader, augment=False)

    def wrong(self, item):
        raise InvalidArgument("crop", f"must fit into frame {item}", (64, 128))

    monkeypatch.setattr(Crops, "_drawn", wrong)
    with pytest.raises(InvalidArgument, match=r"crop: must fit into frame 0; got \(64, 128\)"):
        list(source.batches(2, first=0, last=1, rank=0, world=1, workers=workers))


def test_a_resumed_run_sees_what_the_first_would_have(reader):
    source = crops(reader)
    options = {"rank": 0, "world": 1, "workers": 0}
    straight = list(source.batches(2, first=0, last=4, **options))
    resumed = list(source.batches(2, first=2, last=4, **options))
    assert len(resumed) == 2
    assert all(torch.equal(a[0], b[0]) for a, b in zip(straight[2:], resumed, strict=True))


def test_the_mask_holds_what_the_range_allows():
    truth = torch.tensor([np.nan, 0.0, 0.1, 31.9, 32.0, np.inf])
    assert has_truth(truth, 32).tolist() == [False, False, True, True, False, False]


def test_bad_settings_are_named(reader):
    with pytest.raises(InvalidArgument, match="training pair"):
        Crops(reader, [], (64, 128), seed=0)
    with pytest.raises(InvalidArgument, match="crop"):
        Crops(reader, [0], (64, 512), seed=0)


def test_truth_too_large_to_be_kept_is_unknown_and_counted(reader):
    class Near:
        name, sha256 = reader.name, reader.sha256

        def __getitem__(self, index):
            disparity = np.full((128, 256), 20.0, np.float32)
            disparity[:2], disparity[2], disparity[3] = 300.0, 65535 / 256, np.nan
            return replace(reader[index], disparity=disparity)

    source = crops(Near(), augment=False)
    truth = source.truth(0)
    assert np.isnan(truth[:2]).all() and (truth[2] == 65535 / 256).all() and np.isnan(truth[3]).all()
    assert (truth[4:] == 20).all()
    assert source.too_large(0) == 2 * 256
