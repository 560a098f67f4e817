"""Match the pictures of two cameras, in two folders or in one."""

from __future__ import annotations

import re
from pathlib import Path

from endosdk.errors import InvalidArgument

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".ppm")

NUMBERS_RULE = (
    "must have the same numbers in their names on both sides, such as cam0_0007.png and cam1_0007.png; "
    "a number that is the same in all names of each folder does not count"
)
SIDES_RULE = (
    "in one folder must have the side once in each name, and the same name else, such as f7_left.png and f7_right.png, "
    "f7_L.png and f7_R.png, or left_7.png and right_7.png"
)

# A word of its own: with no letter beside it.
SIDE = re.compile(r"(?<![^\W\d_])(?:(?P<left>left|l)|right|r)(?![^\W\d_])", re.IGNORECASE)

Numbers = tuple[int, ...]
Key = tuple[Numbers, str]  # what the names of a pair share: the numbers that count, and the text where it does


def pair_pictures(left: Path, right: Path) -> list[tuple[Path, Path]]:
    """Pair the pictures of two folders by the numbers in their names, in the order of these.

    Folders whose names are the same are paired by name. A number that never changes, neither in the one folder nor in
    the other, such as that of the camera, does not count. Where both folders are the same one, the names say the side:
    ``f7_left.png`` and ``f7_right.png``, ``_L`` and ``_R``, or ``left_7.png`` and ``right_7.png``, and are the same
    otherwise. Files that are no pictures are passed over. Raises InvalidArgument where a picture has no partner, or
    more than one.
    """
    pictures = _pictures("left", left), _pictures("right", right)
    if left.samefile(right):
        return _matched(*_by_side(pictures[0]), SIDES_RULE)
    stems = [[path.stem for path in side] for side in pictures]
    if stems[0] == stems[1] and len(set(stems[0])) == len(stems[0]):
        return sorted(zip(*pictures, strict=True), key=lambda pair: (_numbers(pair[0].stem), pair[0].stem))
    if len(pictures[0]) == len(pictures[1]) == 1 and _alike(*(side[0].stem for side in pictures)):
        return [(pictures[0][0], pictures[1][0])]
    return _matched(*_by_number(*pictures), NUMBERS_RULE)


def _alike(left: str, right: str) -> bool:
    """Return whether two names differ in the number of the camera alone: in one number, which is not the last."""
    apart = [a != b for a, b in zip(_numbers(left), _numbers(right), strict=False)]
    same_words = re.sub(r"\d+", "0", left) == re.sub(r"\d+", "0", right)
    return same_words and sum(apart) == 1 and not apart[-1]


def has_pictures(folder: Path) -> bool:
    """Return whether a folder holds pictures itself."""
    return any(_is_picture(path) for path in folder.iterdir())


def _is_picture(path: Path) -> bool:
    """Return whether a name is that of a picture. Hidden ones are what a system keeps beside a file, as ``._1.png``."""
    return path.suffix.lower() in ENDINGS and not path.name.startswith(".")


def _pictures(name: str, folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InvalidArgument(name, "must be a folder", str(folder))
    found = sorted(filter(_is_picture, folder.iterdir()))
    if not found:
        raise InvalidArgument(name, f"must hold pictures ({', '.join(ENDINGS)})", str(folder))
    return found


def _numbers(text: str) -> Numbers:
    return tuple(int(digits) for digits in re.findall(r"\d+", text))


def _by_number(left: list[Path], right: list[Path]) -> tuple[dict[Path, Key], dict[Path, Key]]:
    """Return the key of each picture of two folders."""
    numbers = [{path: _numbers(path.stem) for path in side} for side in (left, right)]
    counted = _changing(*(set(side.values()) for side in numbers))
    keys = [
        {path: (found if counted is None else tuple(found[i] for i in counted), "") for path, found in side.items()}
        for side in numbers
    ]
    return keys[0], keys[1]


def _changing(left: set[Numbers], right: set[Numbers]) -> list[int] | None:
    """Return which numbers of a name change in one of the folders; None where that cannot be told.

    Of one picture nobody knows what changes, and of names that are not built alike not which numbers correspond.
    """
    lengths = {len(numbers) for numbers in left | right}
    if len(lengths) != 1 or min(len(left), len(right)) < 2:
        return None
    return [i for i in range(lengths.pop()) if any(len({numbers[i] for numbers in side}) > 1 for side in (left, right))]


def _by_side(pictures: list[Path]) -> tuple[dict[Path, Key], dict[Path, Key]]:
    """Return the key of each left and each right picture of one folder."""
    left: dict[Path, Key] = {}
    right: dict[Path, Key] = {}
    for path in pictures:
        words = list(SIDE.finditer(path.stem))
        if len(words) != 1:
            raise InvalidArgument("pictures", SIDES_RULE, str(path))
        rest = f"{path.stem[: words[0].start()]}|{path.stem[words[0].end() :]}"
        side = left if words[0]["left"] else right
        side[path] = _numbers(rest), rest
    return left, right


def _matched(left: dict[Path, Key], right: dict[Path, Key], rule: str) -> list[tuple[Path, Path]]:
    """Return the pictures of each key, in the order of the keys."""
    by_key = [_by_key(side, rule) for side in (left, right)]
    alone = [str(path) for side, other in (by_key, by_key[::-1]) for key, path in side.items() if key not in other]
    if alone:
        names = ", ".join(sorted(alone)[:3]) + (f" and {len(alone) - 3} more" if len(alone) > 3 else "")
        raise InvalidArgument("pictures", rule, f"{names} without a partner")
    return [(by_key[0][key], by_key[1][key]) for key in sorted(by_key[0])]


def _by_key(side: dict[Path, Key], rule: str) -> dict[Key, Path]:
    found: dict[Key, Path] = {}
    for path, key in side.items():
        if key in found:
            seen = f"{found[key].name} and {path.name} in {path.parent}, which are alike in that"
            raise InvalidArgument("pictures", rule, seen)
        found[key] = path
    return found
