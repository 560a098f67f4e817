"""The reference of the C library says of each name what the header says of it."""

import importlib.util
import re

from endosdk import Reason
from tests.conftest import ROOT

_SPEC = importlib.util.spec_from_file_location("c_header", ROOT / "docs" / "c_header.py")
c_header = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(c_header)
HEADER = (ROOT / "cpp" / "include" / "endosdk" / "endosdk.h").read_text()


def test_a_comment_behind_a_name_comes_before_it():
    lines = ["typedef enum e {", "    A = 1,  /* the first,", "               in two lines */", "    B = 2", "} e;"]
    shown = c_header.documented("\n".join(lines)).removeprefix(c_header.STANDARD)
    assert re.search(r"\{\n    /\*\* the first,\n\s+in two lines \*/\n    A = 1,\n    B = 2\n", shown)
    assert "/**" not in shown.split("A = 1")[1]


def test_every_comment_of_the_header_is_kept_and_marked():
    shown = c_header.documented(HEADER)
    assert shown.count("/**") - shown.count("/** \u2014 */") == HEADER.count("/*") + len(Reason) > 100
    assert not re.search(r"/\*(?!\*)", shown)


def test_members_without_a_comment_are_listed_too():
    assert "/** \u2014 */\n    ENDO_OK = 0,\n" in c_header.documented(HEADER)


def test_the_names_of_the_header_are_all_there():
    macros = {"ENDO_API", "ENDO_REASON_", "ENDO_REASON_BIT"}
    named = set(re.findall(r"\b(?:endo|ENDO)_\w+", HEADER)) - macros | {
        f"ENDO_REASON_{reason.name}" for reason in Reason
    }
    assert named == set(re.findall(r"\b(?:endo|ENDO)_\w+", c_header.documented(HEADER)))


def test_reasons_are_listed_with_bit_and_meaning():
    shown = c_header.documented(HEADER)
    for reason in Reason:
        assert re.search(rf"/\*\* [^*]+\*/\s*ENDO_REASON_{reason.name} = {reason.value},", shown)


def test_statuses_have_their_own_words():
    shown = c_header.documented(HEADER)
    found = re.search(r"/\*\*([^*]*)\*/\s*ENDO_CALIBRATION_SIZE_MISMATCH\b", shown)
    assert "another size" in found[1]
