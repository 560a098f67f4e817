"""The commands for research of the command-line page, run as they stand there on a small set."""

import json
import re
import shlex
from pathlib import Path

import onnxruntime as ort
import pytest

from endosdk.commands.cli import main
from endosdk.datasets.dataset import EndosdkReader
from tests.training.warped_set import write_warped_set

PAGE = Path(__file__).parents[2] / "docs" / "command-line.md"
FRAME = (720, 960)  # of simulate, unless it is told otherwise


def commands(verb):
    lines = re.findall(rf"^endosdk {verb} [^#\n]*", PAGE.read_text(), re.MULTILINE)
    return [shlex.split(line)[1:] for line in lines]


@pytest.fixture
def rendered(tmp_path, monkeypatch):
    """The folders that the page names, and in them sets with as few pairs as training takes."""
    monkeypatch.chdir(tmp_path)
    for root in (Path("data/mix"), Path("data/mine")):
        write_warped_set(root, 9, 1, FRAME, (8.0, 60.0))


def test_the_set_that_is_rendered_has_pairs_for_the_commands_after_it():
    (words,) = commands("simulate")
    assert int(words[words.index("--pairs") + 1]) > 8
    assert int(words[words.index("--test-pairs") + 1]) > 0


def test_the_commands_run_one_after_the_other(rendered, monkeypatch):
    trainings, exports, evaluations = (commands(verb) for verb in ("train", "export", "evaluate"))
    assert len(trainings) == len(exports) == 2 and len(evaluations) == 1
    for words in trainings:
        assert main([*words, "--steps", "1"]) == 0
    read = []
    original = EndosdkReader.__getitem__
    monkeypatch.setattr(
        EndosdkReader,
        "__getitem__",
        lambda self, index: read.append((self.split, self.ids[index])) or original(self, index),
    )
    for words in (*exports, *evaluations):
        assert main(words) == 0
    # Ranges of 8-bit integers are measured on what was trained on: one pair, since eight of the nine are held out.
    assert {name for split, name in read if split == "train"} == {"0000"}
    (int8,) = (words[words.index("--int8") + 1] for words in exports if "--int8" in words)
    recorded = json.loads(ort.InferenceSession(int8).get_modelmeta().custom_metadata_map["endosdk.training"])
    assert recorded["quantisation"]["pairs"] == recorded["data"]["pairs"] == 1
