"""The documentation site: ``make docs`` builds it from the Markdown of the repository, without a network.

The source folder is the repository itself, so that a link means the same on the site and in the plain files.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

import endosdk

sys.path.insert(0, str(Path(__file__).parent))
from c_header import documented

ROOT = Path(__file__).parents[1]

project = "endosdk"
version = release = endosdk.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "hawkmoth"]

include_patterns = [
    "*.md",
    "docs/*.md",
    "docs/**/*.md",
    "models/*.md",
    "benchmarks/README.md",
    "examples/data/README.md",
    "ros1/README.md",
    "ros2/README.md",
]
exclude_patterns = [".*", "build", "dist", "out", "datasets", "runs", "sets"]
root_doc = "docs/index"
# The plain files of the repository are read from links; a history of trials may skip a level of headings.
suppress_warnings = ["toc.not_included", "myst.header"]

myst_heading_anchors = 3

html_theme = "furo"
html_title = f"endosdk {release}"
html_show_copyright = False
html_show_sourcelink = False

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
python_use_unqualified_type_names = True
add_module_names = False

hawkmoth_root = str(ROOT / "build" / "docs")
hawkmoth_clang = ["-std=c11"]
hawkmoth_autoconf: list[str] = []  # no compiler is asked for its headers

SECTION = re.compile(r"^-{4} (.*) -{4}$")
RST_MARKS = re.compile(r"([\\*`_|])")


def _documented_header(app: Sphinx) -> None:
    """Write the header of the C library in the form that hawkmoth wants."""
    target = Path(hawkmoth_root) / "endosdk.h"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(documented((ROOT / "cpp" / "include" / "endosdk" / "endosdk.h").read_text()))


def _as_plain_text(app: Sphinx, lines: list[str], transform: str, options: dict[str, Any]) -> None:
    """Take a comment of the header for plain text: paragraphs, and code where a whole paragraph is indented."""
    parts: list[list[str]] = [[]]
    for line in lines:
        if line.strip():
            parts[-1].append(line)
        elif parts[-1]:
            parts.append([])
    shown: list[str] = []
    in_code = False
    for number, part in enumerate(parts):
        was_code, in_code = in_code, bool(number) and all(line.startswith("    ") for line in part)
        if in_code:
            shown += [*([] if was_code else ["::", ""]), *part, ""]
        else:
            shown += [SECTION.sub(r"**\1**", RST_MARKS.sub(r"\\\1", line.strip())) for line in part] + [""]
    lines[:] = shown


def _without_substitutions(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Let the bars of |d - d*| be bars."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app: Sphinx) -> None:
    """Connect the steps that are ours."""
    app.connect("builder-inited", _documented_header)
    app.connect("hawkmoth-process-docstring", _as_plain_text)
    app.connect("autodoc-process-docstring", _without_substitutions)
