"""The pages that people read: their prose, their code blocks, their commands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from tests.conftest import ROOT

PAGES = [
    *(ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")),
    *(ROOT / folder / "README.md" for folder in ("benchmarks", "examples/data", "ros1", "ros2")),
    *sorted((ROOT / "models").glob("*.md")),
    *(path for path in sorted((ROOT / "docs").rglob("*.md")) if "history" not in path.parts),
]
FENCE = re.compile(r"^(```+)(\S*)[^\n]*\n(.*?)^\1$", re.MULTILINE | re.DOTALL)


def name_of(page: Path) -> str:
    """Path of a page in the repository."""
    return str(page.relative_to(ROOT))


def blocks(page: Path, *languages: str) -> list[str]:
    """Code blocks of a page in these languages, in their order."""
    return [text for _, language, text in FENCE.findall(page.read_text()) if language in languages]


def sentences(page: Path) -> list[str]:
    """Sentences of a page without code, tables, links' targets and headings' marks."""
    text = FENCE.sub("\n\n", page.read_text())
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"^\|.*$", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"^#+ .*$", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[((?:[^\[\]]|\[[^\]]*\])*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"`[^`]*`", "code", text)
    found = []
    for part in re.split(r"\n\s*\n|\n\s*(?=(?:[-*]|\d+\.) )", text):
        part = re.sub(r"^\s*(?:[-*]|\d+\.) ", "", part)
        found += re.split(r"(?<=[.!?])[\"')*]*\s+", " ".join(part.split()))
    return [sentence for sentence in found if sentence]


def word_count(page: Path) -> int:
    """Words of a page with its tables and code, without the bars of tables and comments."""
    text = re.sub(r"<!--.*?-->", "", page.read_text(), flags=re.DOTALL)
    return sum(any(sign.isalnum() for sign in word) for word in text.split())


def commands(page: Path) -> list[list[str]]:
    """Words of every ``endosdk`` command in the page's shell blocks."""
    found = []
    for block in blocks(page, "sh", "bash"):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if "endosdk-bench" in words:
                found.append(["bench", *words[words.index("endosdk-bench") + 1 :]])
            elif "endosdk" in words and words[0] != "cmake":  # which has a target of that name
                found.append(words[words.index("endosdk") + 1 :])
    return found
