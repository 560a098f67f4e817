"""The picture of the import rules shows the imports of the package as it is."""

import re

from benchmarks.studies.import_structure import rooms_and_imports
from tests.conftest import ROOT

PICTURE = ROOT / "docs" / "images" / "architecture.svg"


def reached(start, arrows):
    """Return what arrows lead to from one part."""
    found, waiting = set(), [start]
    while waiting:
        one = waiting.pop()
        new = {b for a, b in arrows if a == one} - found
        found |= new
        waiting += new
    return found


def test_the_picture_has_every_part_and_leads_along_every_import():
    names, imports = rooms_and_imports()
    titles = re.findall(r"<title>(.*?)</title>", PICTURE.read_text())
    arrows = {tuple(title.split("&#45;&gt;")) for title in titles if "&gt;" in title}
    assert {title for title in titles if "&gt;" not in title} >= names
    assert arrows <= imports
    assert all(b in reached(a, arrows) for a, b in imports)
