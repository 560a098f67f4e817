"""The list of slow tests names tests that exist."""

import re

import pytest

from tests.conftest import ROOT, SLOW


@pytest.mark.parametrize("line", [line for line in SLOW.read_text().splitlines() if line.startswith("tests/")])
def test_a_slow_test_exists(line):
    file, _, test = line.partition("::")
    source = (ROOT / file).read_text()
    assert re.search(rf"^def {re.escape(test.partition('[')[0])}\b", source, re.MULTILINE) if test else source
