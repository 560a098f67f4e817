"""Limits and targets of times: the page of benchmarks has those of the scripts, and tells where one is not met."""

import re
from importlib import import_module

from benchmarks.tables.records import SOURCES, read

ROW = re.compile(
    r"^\| `python -m (benchmarks\.speed\.(\w+)) --json FILE` \| "
    r".*(limit|target): (\d+) %([^|]*) \| `results/speed/\2\.json` \|$",
    re.MULTILINE,
)
MEASURED = {
    "temporal": lambda record: [record["share_of_a_frame"]],
    "trust_cost": lambda record: [case["share_of_a_frame"] for case in record["cases"].values()],
    "viewer": lambda record: [record["slowed_by"]],
}


def test_no_record_exceeds_a_limit_and_the_page_tells_by_how_much_one_exceeds_a_target():
    page = (SOURCES / "benchmarks" / "README.md").read_text()
    rows = {name: (import_module(module), *rest) for module, name, *rest in ROW.findall(page)}
    assert rows.keys() == MEASURED.keys()
    assert len(re.findall(r"\b(?:limit|target): ", page)) == len(rows)
    for name, (script, kind, stated, more) in rows.items():
        record = read(f"speed/{name}")
        bound = getattr(script, kind.upper())
        assert bound == record.get("allowed", record.get("allowed_share")) == int(stated) / 100, name
        shares = MEASURED[name](record)
        exceeded = f", measured: {100 * min(shares):.1f} to {100 * max(shares):.1f} %"
        assert max(shares) <= bound or kind == "target", name
        assert more.endswith(exceeded) if max(shares) > bound else "measured" not in more, name
