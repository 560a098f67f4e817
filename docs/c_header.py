"""The header of the C library as hawkmoth documents it: each comment marked, and in front of what it is on."""

from __future__ import annotations

import re

BEHIND = re.compile(r"^(?P<indent>[ \t]*)(?P<code>[^\s/][^\n]*?)[ \t]*/\*(?P<text>.*?)\*/", re.MULTILINE | re.DOTALL)
# A comment with the line it is on, or an enum or a member without one, which hawkmoth would leave out.
BARE = re.compile(
    r"(?P<commented>/\*.*?\*/\n?[^\n]*)"
    r"|(?<=\n)(?P<bare>typedef enum \w+ \{|    (?:ENDO_\w+ = \d+,?|[\w *]+\w(?:\[\w+\])?;))(?=\n)",
    re.DOTALL,
)
SECTION = re.compile(r"^/\* ---- (.*?) ----(.*?)\*/$", re.MULTILINE | re.DOTALL)
ONE_LINE = re.compile(r"^typedef enum (\w+) \{ (.*) \} \1;$", re.MULTILINE)
# The reasons stand in a macro, so that names and meanings can be had from it too; the reference lists them as an enum.
REASONS = re.compile(r"^#define ENDO_REASONS\(.*?^#undef ENDO_REASON_BIT\n", re.MULTILINE | re.DOTALL)
REASON = re.compile(r'REASON\((\w+), (\d+), "(.*?)"\)')
PLAIN_COMMENT = re.compile(r"/\*(?!\*)")
GUARD = re.compile(r"^#ifndef ENDOSDK_H$.*?^#endif$", re.MULTILINE | re.DOTALL)  # to the end of what makes ENDO_API
# The parser comes without the headers of C; it needs the names alone.
STANDARD = """typedef unsigned long size_t; typedef unsigned char uint8_t; typedef unsigned short uint16_t;
typedef unsigned int uint32_t; typedef unsigned long uint64_t; typedef int int32_t; typedef long int64_t;
"""


def documented(header: str) -> str:
    """Return the header with every comment as a documentation comment before its declaration."""
    # In place of the guard a line that declares nothing: else the text on the whole file would be that of the guard.
    text = GUARD.sub("#if 1", header, count=1).replace("ENDO_API ", "")
    text = REASONS.sub(_listed, text)
    text = ONE_LINE.sub(_one_a_line, text)
    text = BEHIND.sub(r"\g<indent>/*\g<text>*/\n\g<indent>\g<code>", text)
    # The same for the headings of sections.
    text = SECTION.sub(r"\g<0>\n#if 1\n#endif", text)
    text = BARE.sub(lambda found: found["commented"] or f"/* \u2014 */\n{found['bare']}", text)
    return STANDARD + PLAIN_COMMENT.sub("/**", text)


def _listed(reasons: re.Match[str]) -> str:
    members = [f"    ENDO_REASON_{name} = {bit},  /* {meaning} */" for name, bit, meaning in REASON.findall(reasons[0])]
    return "\n".join(["typedef enum endo_reason {", *members, "} endo_reason;", ""])


def _one_a_line(enum: re.Match[str]) -> str:
    members = ",\n".join(f"    {member}" for member in enum[2].split(", "))
    return f"typedef enum {enum[1]} {{\n{members}\n}} {enum[1]};"
