"""The program that holds the places and numbers of the header forgets none of them."""

import re

from tests.c_library import binding as c
from tests.conftest import ROOT

HEADER = re.sub(r"/\*.*?\*/", "", c.HEADER.read_text(), flags=re.DOTALL)
ASSERTED = (ROOT / "cpp" / "tests" / "library" / "header.c").read_text()
BODIES = dict(re.findall(r"typedef struct (endo_\w+) \{(.*?)\} endo_\w+;", HEADER, re.DOTALL))
FIELDS = [(struct, field) for struct, body in BODIES.items() for field in re.findall(r"(\w+)(?:\[\w+\])?;", body)]


def test_the_place_of_every_field_is_asserted():
    asserted = re.findall(r"^PLACE\((\w+), (\w+), \d+\);", ASSERTED, re.MULTILINE)
    assert sorted(asserted) == sorted(FIELDS)


def test_the_size_of_every_struct_is_asserted():
    sizes = re.findall(r"^_Static_assert\(sizeof\((\w+)\) == \d+, \"\1\"\);", ASSERTED, re.MULTILINE)
    assert sorted(sizes) == sorted(BODIES)


def test_every_number_is_asserted():
    enums = re.findall(r"typedef enum endo_\w+ \{(.*?)\}", HEADER, re.DOTALL)
    numbers = [name for body in enums for name in re.findall(r"\bENDO_\w+(?= = )", body)]
    reasons = [f"ENDO_REASON_{name}" for name in re.findall(r"^    REASON\((\w+), ", HEADER, re.MULTILINE)]
    asserted = re.findall(r"^VALUE\((\w+), \d+\);", ASSERTED, re.MULTILINE)
    assert sorted(asserted) == sorted([*numbers, *reasons, "ENDO_MOST_CAUSES"])
