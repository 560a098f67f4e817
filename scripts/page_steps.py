"""A page of instructions as one shell script, word for word: its commands, the files that it shows, its Python code."""

from __future__ import annotations

import re
from pathlib import Path

BLOCK = re.compile(r"^```(sh|c|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE_NAME = re.compile(r"`([\w.]+)`:\s*\Z")  # what stands before a block that is a file to write


def script(page: Path, way: str = "") -> str:
    """Return what a reader types who takes one of the ways; a way is a heading of the third level.

    A section without ways is for all readers. Each section tells its name and the seconds so far on standard error.
    """
    lines: list[str] = []
    for section in re.split(r"^(?=## )", page.read_text(), flags=re.MULTILINE):
        common, *ways = re.split(r"^(?=### )", section, flags=re.MULTILINE)
        chosen = [text for text in ways if text.startswith(f"### {way}\n")]
        commands = [line for text in [common, *chosen] for line in _commands(text)]
        if commands:
            title = section.partition("\n")[0].lstrip("# ")
            lines += [*commands, f'echo "$SECONDS s: {title}" >&2']
    return "\n".join(lines) + "\n"


def ways(page: Path) -> list[str]:
    """Return the ways that a reader can take."""
    return re.findall(r"^### (.+)$", page.read_text(), re.MULTILINE)


def _commands(text: str) -> list[str]:
    """Return the commands of each block."""
    found = []
    for block in BLOCK.finditer(text):
        language, content = block.groups()
        if language == "sh":
            found.append(content)
        elif language == "python":
            found.append(f"python - << 'END_OF_CODE'\n{content}END_OF_CODE")
        elif name := FILE_NAME.search(text[: block.start()]):
            found.append(f"cat > {name[1]} << 'END_OF_FILE'\n{content}END_OF_FILE")
        else:
            raise ValueError(f"a block without the name of its file: {content.partition(chr(10))[0]}")
    return found
