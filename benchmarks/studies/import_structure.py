"""Who imports whom among the rooms of the package, counted and drawn.

    python -m benchmarks.studies.import_structure --svg docs/images/imports_after.svg
    python -m benchmarks.studies.import_structure --reduced --svg docs/images/architecture.svg

It looks at the package that this interpreter has. The interpreter of another environment draws another version.
Drawing needs graphviz (``dot``, ``tred``).
Imports of the package itself, of ``errors`` and of the compiled core are left out: nearly everything imports them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from pathlib import Path

import grimp

PACKAGE = "endosdk"
LEFT_OUT = {"", "errors", "_core", "__main__"}


def rooms_and_imports() -> tuple[set[str], set[tuple[str, str]]]:
    """Return the names at the top of the package, and the pairs (importer, imported)."""
    graph = grimp.build_graph(PACKAGE, cache_dir=None)
    names = {_room(module) for module in graph.modules} - LEFT_OUT
    imports = {
        (_room(module), _room(imported))
        for module in graph.modules
        for imported in graph.find_modules_directly_imported_by(module)
    }
    return names, {(a, b) for a, b in imports if a != b and a in names and b in names}


def _room(module: str) -> str:
    return [*module.split("."), ""][1]


def in_circles(imports: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """Return the imports that lie on a circle."""

    def reachable(start: str) -> set[str]:
        found: set[str] = set()
        waiting = [start]
        while waiting:
            for a, b in imports:
                if a == waiting[-1] and b not in found:
                    found.add(b)
                    waiting.append(b)
                    break
            else:
                waiting.pop()
        return found

    beyond = {name: reachable(name) for name in {b for _, b in imports}}
    return {(a, b) for a, b in imports if a in beyond[b]}


def drawing(names: set[str], imports: set[tuple[str, str]]) -> str:
    """Return the picture in the language of graphviz; circles are red."""
    red = in_circles(imports)
    lines = ['digraph { node [shape=box, style="rounded,filled", fillcolor="#eef3f8", fontname=Helvetica, fontsize=11]']
    lines += ['edge [arrowsize=0.6, color="#5a6b7b"]']
    lines += [f'"{name}"' for name in sorted(names)]
    lines += [f'"{a}" -> "{b}"' + (" [color=red]" if (a, b) in red else "") for a, b in sorted(imports)]
    return "\n".join([*lines, "}"])


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--svg", type=Path, required=True, metavar="FILE")
    parser.add_argument("--reduced", action="store_true", help="leave out imports that a longer way implies")
    args = parser.parse_args()
    names, imports = rooms_and_imports()
    picture = drawing(names, imports)
    if args.reduced:
        picture = subprocess.run(["tred"], input=picture, text=True, capture_output=True, check=True).stdout
    subprocess.run(["dot", "-Tsvg", "-o", args.svg], input=picture, text=True, check=True)
    print(json.dumps({"names": len(names), "imports": len(imports), "in_circles": len(in_circles(imports))}))


if __name__ == "__main__":
    main()
