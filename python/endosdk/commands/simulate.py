"""``endosdk simulate``: render stereo pairs with exact truth, or check a set that was rendered."""

from __future__ import annotations

import argparse
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from endosdk.commands.options import add_processes
from endosdk.commands.report import Report

if TYPE_CHECKING:
    from endosdk.simulation.recipe import Recipe

# What describes a set, which a published recipe settles: default value, and what the option means.
_SETTINGS: dict[str, tuple[str | int | float | bool, str]] = {
    "organ": (
        "mix",
        "intestine, stomach, ducts, abdomen; gi (the first three), mix (all); lap: all, and instruments near the lens; "
        "shapes: no organ, objects of any kind",
    ),
    "pairs": (100, "training pairs, or videos"),
    "test_pairs": (0, "test pairs, with different seeds"),
    "seed": (1, "0..9999; another seed is another set"),
    "renderer": ("gl", "gl: OpenGL through EGL; cycles: Blender, path traced"),
    "rig": ("ideal", "ideal; raw: also distorted, misaligned views and rig.json; drawn: random rig per scene"),
    "aspect": ("fixed", "fixed, or drawn: with --rig drawn, frames of 4:3, 5:4 and 16:9"),
    "width": (960, "pixels"),
    "height": (720, "pixels (default: 3/4 of the width)"),
    "focal": (400.0, "focal length in pixels (default: 400 at a width of 960, in proportion to it)"),
    "baseline": (10.0, "mm between the lenses"),
    "min_disparity": (2.0, "px, target value; not with --rig drawn or --organ lap or shapes"),
    "max_disparity": (
        69.5,
        "px, upper limit (default: 69.5 at a width of 960, as --focal; --rig drawn: 25 %% of the width; at most 250)",
    ),
    "faults": (
        False,
        "add image faults: field of view, vertical disparity, blur of one view, glare, smoke, noise and more",
    ),
    "video": (False, "render a video with a moving camera instead of each pair"),
    "frames": (100, "frames of each video, 25 per second"),
    "shutter": (0.0, "video: share of the frame time it is open"),
    "motion_blur": (0.0, "pairs: longest streak in px"),
    "chroma": (False, "4:2:0 chroma subsampling"),
    "bubbles": (False, "draw bubbles in the film on a mucosa"),
    "emitters": (2, "1 or 2: number of lamps at the camera"),
    "vignetting": (True, "no vignetting"),
    "glare": (True, "no scattered light"),
    "exposure_difference": (True, "same exposure and tint in both sensors"),
    "noise": (True, "no sensor noise"),
    "compression": (True, "no JPEG artefacts"),
}


# What is of rendering, and its value when it is not given.
_RENDERING: dict[str, object] = {"workers": 1, "ray": False, "cycles_python": None}


def _option(name: str) -> str:
    """Return the option of a setting; what is usually on has one that switches it off."""
    switched_off = name in _SETTINGS and _SETTINGS[name][0] is True
    return ("--no-" if switched_off else "--") + name.replace("_", "-")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", type=Path, metavar="DIR", help="output folder; an unfinished data set is continued")
    what.add_argument("--check", type=Path, metavar="DIR", help="compare a data set with its recorded hashes")
    what.add_argument("--setup-cycles", action="store_true", help="install Blender for --renderer cycles, by pip")
    parser.add_argument(
        "--spoil",
        type=Path,
        metavar="DIR",
        help="do not render: add --faults to this existing set and write it to --out (default: render)",
    )
    parser.add_argument(
        "--recipe",
        metavar="NAME",
        help="recipe of a published set, such as endosim-lap; fixes all options except --pairs and --test-pairs "
        "(default: none)",
    )
    described = parser.add_argument_group("data set options")
    for name, (default, text) in _SETTINGS.items():
        if isinstance(default, bool):
            action = "store_false" if default else "store_true"
            described.add_argument(_option(name), dest=name, action=action, default=None, help=text)
        else:
            described.add_argument(
                _option(name), type=type(default), help=text if "default" in text else f"{text} (default: {default})"
            )
    described.add_argument(
        "--textures",
        type=Path,
        metavar="DIR",
        help="images of real tissue, used as colour textures (default: random colours)",
    )
    add_processes(parser)
    parser.add_argument(
        "--cycles-python",
        type=Path,
        metavar="PATH",
        help="a Python with bpy, for --renderer cycles (default: that of --setup-cycles)",
    )


def run(args: argparse.Namespace) -> int:
    """Do what the arguments say; return the exit status."""
    if args.setup_cycles:
        _take_nothing_else(args, "setup_cycles", "installs Blender")
        from endosdk.simulation.cycles.environment import set_up

        report = Report(args)
        report.record["python"] = set_up()
        report.line(str(report.record["python"]))
        return report.end()
    if args.check is not None:
        _take_nothing_else(args, "check", "reads a set as it is")
        return _check(args)
    return _spoil(args) if args.spoil is not None else _render(args)


def _take_nothing_else(args: argparse.Namespace, name: str, what: str) -> None:
    """Refuse the options that only a set to be written has."""
    from endosdk.errors import InvalidArgument

    usual = {**dict.fromkeys(("spoil", "recipe", *_SETTINGS, "textures")), **_RENDERING}
    given = [_option(other) for other, value in usual.items() if getattr(args, other) != value]
    if given:
        raise InvalidArgument(name, f"{what}, so leave out the rest", ", ".join(given))


def _check(args: argparse.Namespace) -> int:
    from endosdk.datasets.verifier import verify_dataset

    report = Report(args)
    count = 0
    faults: dict[str, str] = {}
    for name, fault in verify_dataset(args.check):
        count += 1
        if fault is not None:
            faults[name] = fault
            report.line(f"{name}: {fault}")
    report.record = {"samples": count, "faults": faults}
    report.line(f"{count - len(faults)} of {count} samples are as recorded")
    return report.end(usable=not faults)


def _spoil(args: argparse.Namespace) -> int:
    from endosdk.errors import InvalidArgument
    from endosdk.simulation.faults.spoil_set import spoil_set

    given = [name for name in (*_SETTINGS, "textures") if getattr(args, name) is not None and name != "seed"]
    if given or args.recipe is not None:
        options = ", ".join([*(_option(name) for name in given), *(["--recipe"] if args.recipe else [])])
        raise InvalidArgument("spoil", "takes the pairs as they are, so leave out the rest but --seed", options)
    for name, without in _RENDERING.items():
        if getattr(args, name) != without:
            raise InvalidArgument(name, "is for rendering; leave it out with --spoil", getattr(args, name))
    try:
        record = spoil_set(args.spoil, args.out, args.seed if args.seed is not None else 1)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; the same command continues {args.out}") from None
    report = Report(args)
    report.record = {"out": args.out, "pairs": sum(len(ids) for ids in record["samples"].values())}
    report.line(f"{args.out}: {report.record['pairs']} spoiled pairs")
    return report.end()


def _render(args: argparse.Namespace) -> int:
    from endosdk.simulation.generate import generate

    recipe = _recipe(args)
    try:
        record = generate(args.out, recipe, args.workers, progress=True, cycles_python=args.cycles_python, ray=args.ray)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"stopped; the same command continues {args.out}") from None
    counts = {split: len(ids) for split, ids in record["samples"].items()}
    report = Report(args)
    report.record = {"out": args.out, "pairs": counts}
    report.line(f"{args.out}: {counts['train']} training and {counts['test']} test pairs")
    return report.end()


# What a recipe calls otherwise than the command line does.
_OPTIONS_OF = {
    "limits": "min_disparity, max_disparity",
    "motion_px": "motion_blur",
    "focal_px": "focal",
    "baseline_mm": "baseline",
}


def _recipe(args: argparse.Namespace) -> Recipe:
    from endosdk.errors import InvalidArgument

    try:
        return _described_recipe(args)
    except InvalidArgument as error:
        raise InvalidArgument(_OPTIONS_OF.get(error.argument, error.argument), error.rule, error.value) from error


def _described_recipe(args: argparse.Namespace) -> Recipe:
    from endosdk.errors import InvalidArgument
    from endosdk.simulation.camera import StereoCamera
    from endosdk.simulation.effects import Effects
    from endosdk.simulation.recipe import Recipe, published
    from endosdk.simulation.sample import DisparityLimits
    from endosdk.simulation.scene import LAP, SHAPES
    from endosdk.simulation.tissue_pictures import find_pictures

    given = [name for name in (*_SETTINGS, "textures") if getattr(args, name) is not None]
    if args.recipe is not None:
        counts = {name: getattr(args, name) for name in given if name in ("pairs", "test_pairs")}
        if len(given) > len(counts):
            options = ", ".join(_option(name) for name in given if name not in counts)
            raise InvalidArgument("recipe", "settles what describes a set, so leave out the rest", options)
        return replace(published(args.recipe).recipe, **counts)
    video = bool(args.video)
    if not video and "frames" in given:
        raise InvalidArgument("frames", "are those of a video; add --video", args.frames)
    chosen: dict[str, Any] = {name: getattr(args, name) if name in given else _SETTINGS[name][0] for name in _SETTINGS}
    if chosen["organ"] == SHAPES:
        _leave_to_organs(chosen, given)
    if video and chosen["frames"] < 1:
        raise InvalidArgument("frames", "must be at least 1 for a video", chosen["frames"])
    _follow_the_width(chosen, given)
    if chosen["rig"] == "drawn":
        _leave_to_the_scenes(chosen, given)
    if chosen["rig"] == "drawn" or chosen["organ"] in (LAP, SHAPES):
        _leave_to_the_range(chosen, given)
    same_name = {field.name: chosen[field.name] for field in fields(Effects) if field.name in chosen}
    return Recipe(
        **{
            name: chosen[name]
            for name in ("organ", "pairs", "test_pairs", "seed", "renderer", "rig", "aspect", "faults")
        },
        camera=StereoCamera(chosen["width"], chosen["height"], chosen["focal"], chosen["baseline"]),
        limits=DisparityLimits(chosen["min_disparity"], chosen["max_disparity"]),
        effects=Effects(
            motion_px=chosen["motion_blur"],
            textures=find_pictures(args.textures) if args.textures is not None else (),
            **same_name,
        ),
        frames=chosen["frames"] if video else 0,
    )


def _follow_the_width(chosen: dict[str, Any], given: list[str]) -> None:
    """Choose the lengths that are not given so that the camera sees what it sees at the default width."""
    from endosdk.simulation.rigs import WIDEST_DISPARITY
    from endosdk.simulation.sample import MOST_DISPARITY

    width = chosen["width"]
    lengths = {name: chosen[name] * width / _SETTINGS["width"][0] for name in ("focal", "height", "max_disparity")}
    lengths["height"] = round(lengths["height"])
    if chosen["rig"] == "drawn":
        lengths["max_disparity"] = WIDEST_DISPARITY * width
    lengths["max_disparity"] = min(lengths["max_disparity"], float(MOST_DISPARITY))
    chosen.update({name: length for name, length in lengths.items() if name not in given})


def _leave_to_the_scenes(chosen: dict[str, Any], given: list[str]) -> None:
    """Refuse what every scene draws for itself."""
    from endosdk.errors import InvalidArgument

    drawn = ["focal", "baseline", *(["height"] if chosen["aspect"] == "drawn" else [])]
    for name in drawn:
        if name in given:
            raise InvalidArgument(name, "is drawn for every scene, so leave it out", chosen[name])


def _leave_to_organs(chosen: dict[str, Any], given: list[str]) -> None:
    """Refuse the effects that only tissue and its cameras have."""
    from endosdk.errors import InvalidArgument
    from endosdk.simulation.effects import Effects

    effects = {"motion_blur", *(field.name for field in fields(Effects))} & _SETTINGS.keys()
    changed = {name for name in effects if chosen[name] != _SETTINGS[name][0]} | {"textures"}
    refused = [_option(name) for name in given if name in changed]
    if refused:
        raise InvalidArgument("organ", f"shapes has no effects of organs; leave out {', '.join(refused)}", "shapes")


def _leave_to_the_range(chosen: dict[str, Any], given: list[str]) -> None:
    """Refuse what does not count where every scene draws the range that its rig looks at."""
    from endosdk.errors import InvalidArgument

    if "min_disparity" in given:
        rule = "is drawn for every scene, so leave it out"
        raise InvalidArgument("min_disparity", rule, chosen["min_disparity"])
    chosen["min_disparity"] = min(chosen["min_disparity"], chosen["max_disparity"] / 4)
    for name in ("noise", "compression"):
        if chosen["faults"] and name in given:
            raise InvalidArgument(name, "comes with --faults here, so leave it out", _option(name))
