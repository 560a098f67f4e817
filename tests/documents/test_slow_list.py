"""The list of slow tests names tests that exist."""

import re

import pytest

from tests.conftest import IDLE_LINES, ROOT, SLOW


@pytest.mark.parametrize("line", [line for line in SLOW.read_text().splitlines() if line.startswith("tests/")])
def test_a_slow_test_exists(line):
    file, _, test = line.partition("::")
    source = (ROOT / file).read_text()
    assert re.search(rf"^def {re.escape(test.partition('[')[0])}\b", source, re.MULTILINE) if test else source


def test_every_line_stands_for_a_test(pytestconfig):
    """A parameter or a fixture that was renamed leaves a line that marks nothing."""
    collected = [(pytestconfig.invocation_params.dir / place).resolve() for place in pytestconfig.args]
    if collected != [ROOT / "tests"] or pytestconfig.getoption("lf", False):
        pytest.skip("only a collection of all tests tells")
    assert pytestconfig.stash[IDLE_LINES] == []
