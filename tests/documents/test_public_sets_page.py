"""The page on data sets of others names what the code knows: layouts, parts and their lengths."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.commands.evaluate import PARTS
from endosdk.datasets.layouts import READERS
from endosdk.evaluation import edges, frame_parts
from tests.conftest import ROOT
from tests.datasets.test_layouts import write_scared
from tests.documents.pages import blocks

PAGE = (ROOT / "docs" / "public-sets.md").read_text()


def test_every_layout_has_its_command_and_every_part_its_line() -> None:
    assert set(re.findall(r"--layout (\w+)", PAGE)) - {"NAME"} == set(READERS)
    for name in PARTS:
        assert f"`{name}`" in PAGE


def test_lengths_are_those_of_the_code() -> None:
    assert f"at most {edges.BAND:.0f} px from a depth edge: two pixels up to {edges.NEIGHBOURS:.0f} px apart" in PAGE
    assert f"differ by more than {edges.JUMP:.0f} px" in PAGE and f"frame {edges.WIDTH} px wide" in PAGE
    assert f"at most {frame_parts.HALO:.0f} px from a pixel" in PAGE
    assert f"channels are all {frame_parts.BLOWN_OUT} or more" in PAGE
    window = f"less than {frame_parts.NO_TEXTURE} of 255 within {frame_parts.TEXTURE_WINDOW:.0f} px"
    assert window in PAGE


def test_the_python_of_the_page_scores_a_method(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_scared(tmp_path / "SCARED/dataset_8/keyframe_1")
    (block,) = blocks(ROOT / "docs/public-sets.md", "python")
    exec(block, {"my_matcher": lambda left, _: np.full(left.shape[:2], 5, np.float32)})
    assert float(capsys.readouterr().out) > 0


@pytest.mark.parametrize("layout", sorted(READERS))
def test_commands_of_the_page_are_taken_and_an_empty_folder_is_refused(
    layout: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "--model", "sgbm", "--layout", layout, "--data", str(tmp_path)]) != 0
    assert f"must hold samples in the layout {layout}" in capsys.readouterr().err
