import numpy as np
import pytest

from endosdk.datasets.dataset import FORMAT_VERSION
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.writer import write_dataset_record
from endosdk.errors import InvalidArgument
from endosdk.training.config import TrainConfig
from endosdk.training.sets import HeldOutReader, JoinedReader, open_sets, split_pairs
from tests.training.warped_set import write_warped_set


@pytest.fixture(scope="module")
def roots(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets")
    for name, pairs in (("small", 3), ("large", 5)):
        write_warped_set(folder / name, pairs, 1, (64, 128), (3.0, 20.0))
    return str(folder / "small"), str(folder / "large")


def test_several_sets_read_as_one(roots):
    reader = open_sets(roots, "train", "endosdk")
    parts = [open_sets([root], "train", "endosdk") for root in roots]
    assert isinstance(reader, JoinedReader)
    assert len(reader) == 8
    assert reader.name == "small + large"
    for index, (part, place) in enumerate([(parts[0], i) for i in range(3)] + [(parts[1], i) for i in range(5)]):
        np.testing.assert_array_equal(reader[index].left, part[place].left)
        assert reader.ids[index].endswith(part.ids[place])
    assert reader.sha256 not in (part.sha256 for part in parts)
    assert reader.sha256 != open_sets(roots[::-1], "train", "endosdk").sha256
    with pytest.raises(InvalidArgument, match="data"):
        open_sets([], "train", "endosdk")


def test_every_choice_of_pairs_has_hashes_of_its_own(roots):
    small, large = (open_dataset(root, "train") for root in roots)
    readers = [small, large, JoinedReader([small, large]), JoinedReader([large, small])]
    assert len({reader.sha256 for reader in readers}) == len({reader.split_sha256 for reader in readers}) == 4
    held_out = [HeldOutReader(large, indices) for indices in ([0], [0, 1])]
    assert {reader.sha256 for reader in held_out} == {large.sha256}
    assert len({reader.split_sha256 for reader in (large, *held_out)}) == 3


def films(folder, *frames):
    """Set of so many frames of each film, of which nothing but the record is there."""
    root = folder / "_".join(map(str, frames))
    root.mkdir()
    ids = [f"{film:09d}-{frame:04d}" for film, count in enumerate(frames) for frame in range(count)]
    samples = {"train": dict.fromkeys(ids, "not read"), "test": {}}
    write_dataset_record(root, {"format_version": FORMAT_VERSION, "name": "films", "samples": samples})
    return open_dataset(root, "train")


def test_no_frame_of_a_film_that_is_held_out_is_trained_on(tmp_path, caplog):
    reader = films(tmp_path, 10, 10, 10)
    learned, held_out = split_pairs(reader, TrainConfig(held_out=4))
    assert learned == list(range(20))
    assert held_out == [20, 23, 26, 29]
    learned, held_out = split_pairs(reader, TrainConfig(held_out=12))
    assert learned == list(range(10))
    assert len(set(held_out)) == 12 and {reader.film(index) for index in held_out} == {"000000001", "000000002"}
    assert split_pairs(reader, TrainConfig(held_out=20)) == (list(range(10)), list(range(10, 30)))
    assert split_pairs(reader, TrainConfig(held_out=25)) == (list(range(10)), list(range(10, 30)))
    assert split_pairs(reader, TrainConfig(held_out=0)) == (list(range(30)), [])
    joined = JoinedReader([films(tmp_path, 5, 5), films(tmp_path, 4, 4)])
    assert split_pairs(joined, TrainConfig(held_out=2)) == ([*range(5), *range(10, 14)], [5, 9, 14, 17])
    assert joined.film(13) == joined.film(10) != joined.film(14)
    assert caplog.text == ""


def test_a_set_of_one_film_is_split_with_a_warning(tmp_path, caplog):
    assert split_pairs(films(tmp_path, 6), TrainConfig(held_out=2)) == ([0, 1, 2, 3], [4, 5])
    assert "films is one film" in caplog.text


def test_the_last_pairs_of_every_set_are_held_out(roots):
    reader = open_sets(roots, "train", "endosdk")
    learned, held_out = split_pairs(reader, TrainConfig(held_out=2))
    assert learned == [0, 3, 4, 5]
    assert held_out == [1, 2, 6, 7]
    assert split_pairs(reader, TrainConfig(held_out=2, train_pairs=3))[0] == [0, 3, 4]
    with pytest.raises(InvalidArgument, match=r"held_out: .* of small"):
        split_pairs(reader, TrainConfig(held_out=3))
