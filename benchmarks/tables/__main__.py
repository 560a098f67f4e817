"""Write the tables of the pages anew, or tell whether one differs from its record.

python -m benchmarks.tables
python -m benchmarks.tables --check
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.tables.pages import DOCUMENTS, filled
from benchmarks.tables.records import SOURCES


def main(words: list[str] | None = None, root: Path = SOURCES) -> int:
    """Write the tables of the pages under a folder, or with --check name the pages that would change."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.tables", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 where a page would change")
    args = parser.parse_args(words)
    stale = 0
    for name in DOCUMENTS:
        path = root / name
        before = path.read_text()
        after = filled(before)
        if after == before:
            continue
        stale += 1
        print(f"{name}: {'differs from the records' if args.check else 'written'}")
        if not args.check:
            path.write_text(after)
    return 1 if args.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
