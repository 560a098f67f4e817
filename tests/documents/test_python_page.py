"""The page on the Python package runs as it stands."""

from __future__ import annotations

import re
import shutil

from tests.conftest import ROOT

PAGE = ROOT / "docs" / "python.md"


def test_every_example_runs_in_order(tmp_path, monkeypatch):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(blocks) == 9
    shutil.copytree(ROOT / "examples" / "data", tmp_path / "examples" / "data")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    assert (tmp_path / "points.ply").stat().st_size > 15 * names["count"] > 0


def test_every_layout_is_named():
    from endosdk.calibration.files import LAYOUTS

    for layout in LAYOUTS:
        assert f"`{layout}`" in PAGE.read_text()
