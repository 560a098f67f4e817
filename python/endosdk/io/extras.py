"""Optional dependencies: which extra of this package brings one, and the command that installs it."""

from __future__ import annotations

import re
import shlex

from endosdk.errors import DependencyMissing


def dependency_missing(error: ImportError) -> DependencyMissing | None:
    """Say which extra brings a module that could not be imported; None where no extra of ours does."""
    package = (error.name or "").partition(".")[0]
    extra = extra_of(package)
    return None if extra is None else DependencyMissing(package, must_install(extra), "nothing")


def extra_of(package: str) -> str | None:
    """Return the first extra of this package that brings another one."""
    for requirement, extra in _optional_requirements():
        if re.split(r"[^A-Za-z0-9_.-]", requirement)[0] == package:
            return extra
    return None


def must_install(extra: str) -> str:
    """Return the rule that a missing dependency breaks."""
    return f"must be installed ({install_command(extra)})"


def must_install_package(package: str) -> str:
    """Return the rule that a missing package breaks which no extra brings."""
    return f"must be installed ({_pip_install([package])})"


def install_command(extra: str) -> str:
    """Return the command that installs what an extra needs, wherever this package itself came from."""
    wanted = [requirement for requirement, its in _optional_requirements() if its == extra]
    return _pip_install(wanted or [f"endosdk[{extra}]"])


def _pip_install(requirements: list[str]) -> str:
    return "python -m pip install " + " ".join(shlex.quote(one) for one in requirements)


def _optional_requirements() -> list[tuple[str, str]]:
    """Return (requirement, extra) of every extra that the installed package declares."""
    from importlib import metadata

    try:
        declared = metadata.requires("endosdk") or []
    except metadata.PackageNotFoundError:  # a copy without its metadata, as in a frozen program
        declared = []
    found = (re.fullmatch(r"(.+?)\s*;\s*extra\s*==\s*['\"](\w+)['\"]", line) for line in declared)
    return [(match[1], match[2]) for match in found if match]
