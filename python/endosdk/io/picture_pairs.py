"""Match the pictures of two folders, one of each camera."""

from __future__ import annotations

import re
from pathlib import Path

from endosdk.errors import InvalidArgument

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def pair_pictures(left: Path, right: Path) -> list[tuple[Path, Path]]:
    """Pair the pictures of two folders by the numbers in their names, in the order of these.

    Files that are no pictures are passed over. Raises InvalidArgument where a picture has no partner, or more than one.
    """
    sides = [_by_number(name, folder) for name, folder in (("left", left), ("right", right))]
    alone = sorted(
        str(path) for key, path in [*sides[0].items(), *sides[1].items()] if not all(key in s for s in sides)
    )
    if alone:
        names = ", ".join(alone[:3]) + (f" and {len(alone) - 3} more" if len(alone) > 3 else "")
        raise InvalidArgument("pictures", "must have the same numbers in their names on both sides", names)
    return [(sides[0][key], sides[1][key]) for key in sorted(sides[0])]


def _by_number(name: str, folder: Path) -> dict[tuple[int, ...], Path]:
    if not folder.is_dir():
        raise InvalidArgument(name, "must be a folder", str(folder))
    found: dict[tuple[int, ...], Path] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in ENDINGS:
            continue
        key = tuple(int(digits) for digits in re.findall(r"\d+", path.stem))
        if key in found:
            two = f"{found[key].name} and {path.name} in {folder}"
            raise InvalidArgument(name, "must hold pictures whose names differ in their numbers", two)
        found[key] = path
    if not found:
        raise InvalidArgument(name, f"must hold pictures ({', '.join(ENDINGS)})", str(folder))
    return found
