"""Every page is short of breath, its Python runs as it stands, its commands exist, and its links lead somewhere."""

from __future__ import annotations

import re
import shutil
from fnmatch import fnmatch

import numpy as np
import pytest

import endosdk
from endosdk.commands.cli import VERBS, build_parser
from endosdk.io.pictures import read_frame, write_picture
from tests.conftest import ROOT
from tests.documents.pages import FENCE, PAGES, blocks, commands, name_of, sentences, word_count
from tests.live.videos import write

MOST_WORDS = 32
README_WORDS = 700
CARD_WORDS = 600

# A page whose Python has a test of its own, which looks at what it leaves behind.
ELSEWHERE = {
    "docs/public-sets.md": "tests/documents/test_public_sets_page.py",
    "docs/python.md": "tests/documents/test_python_page.py",
}


pages = pytest.mark.parametrize("page", PAGES, ids=name_of)


def links(page):
    """Files that a page links to, as it names them."""
    text = FENCE.sub("", page.read_text())
    return [target for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text) if "://" not in target]


def test_commands_python_and_links_are_found():
    """Many pages have none of one kind: what finds them must not find nothing at all."""
    assert "docs/python.md" in links(ROOT / "README.md")
    assert blocks(ROOT / "docs/python.md", "python")
    assert {words[0] for page in PAGES for words in commands(page)} == set(VERBS)


@pages
def test_no_sentence_is_too_long(page):
    long = [sentence for sentence in sentences(page) if len(sentence.split()) > MOST_WORDS]
    assert long == []


def test_a_long_sentence_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Title\n\nShort.\n\n- one\n- " + "word " * 33 + "\n\n| " + "cell " * 40 + "|\n")
    assert [len(sentence.split()) for sentence in sentences(page)] == [1, 1, 33]


def test_the_readme_and_the_cards_are_short():
    assert word_count(ROOT / "README.md") <= README_WORDS
    for card in (ROOT / "models").glob("*.md"):
        assert word_count(card) <= CARD_WORDS, card


def test_cards_have_one_form():
    headings = [re.findall(r"^## (.+)$", card.read_text(), re.MULTILINE) for card in (ROOT / "models").glob("*.md")]
    assert len(headings) == 4 and headings.count(headings[0]) == 4


@pages
def test_commands_exist_and_take_these_options(page):
    for words in commands(page):
        build_parser(VERBS).parse_args(words)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A folder as a reader has it: the demo pair and its rig by the names that pages use, and a video of it."""
    folder = tmp_path_factory.mktemp("pages")
    shutil.copytree(ROOT / "examples" / "data", folder / "examples" / "data")
    rig = endosdk.StereoCalibration.load(folder / "examples/data/rig.json")
    for name in ("rig.json", "rig.yaml"):
        rig.save(folder / name)
    views = [read_frame(folder / f"examples/data/demo/{side}.png") for side in ("left", "right")]
    for side, view in zip(("left", "right"), views, strict=True):
        write_picture(folder / f"{side}.png", view)
    write(folder / "surgery.mp4", [np.vstack(views)] * 2)
    estimator = endosdk.DepthEstimator("fast", calibration=rig)
    names = {"endosdk": endosdk, "np": np, "rig": rig, "left": views[0], "right": views[1]}
    return folder, {**names, "depth": estimator, "estimator": estimator}


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=name_of)
def test_python_runs_in_order(page, bench, monkeypatch):
    if name_of(page) in ELSEWHERE:
        assert (ROOT / ELSEWHERE[name_of(page)]).is_file()
        return
    folder, names = bench
    monkeypatch.chdir(folder)
    names = dict(names)
    for block in blocks(page, "python"):
        try:
            exec(compile(block, str(page), "exec"), names)
        except endosdk.errors.ProviderUnavailable as error:
            pytest.skip(f"runs where the provider is there: {error}")


@pages
def test_links_lead_to_files(page):
    for target in links(page):
        assert (page.parent / target).exists(), target


def test_every_page_is_in_the_index():
    index = (ROOT / "docs" / "index.md").read_text()
    patterns = [line for block in re.findall(r"```{toctree}(.*?)```", index, re.DOTALL) for line in block.split()]
    for page in sorted((ROOT / "docs").rglob("*.md")):
        name = str(page.relative_to(ROOT / "docs").with_suffix(""))
        assert name == "index" or any(fnmatch(name, pattern) for pattern in patterns), name
