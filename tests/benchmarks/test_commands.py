"""The command of a record can be given again: its module is there, its parser takes the words, and none is missing."""

import argparse
import importlib
import json
import shlex
import sys
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.accuracy import pareto_front
from benchmarks.record import as_given
from benchmarks.studies import clean_teacher, likely_step, recipe_gains, saturation
from benchmarks.tables.records import RESULTS

# Options that say where a run writes; records leave them out.
WRITTEN = {"json", "figure", "out", "runs", "films"}
# Of runs whose commands ended in dots: they have the hashes of their sets, but not the names of the folders.
WITHOUT_SETS = {"studies/recipe_gains", "studies/clean_teacher"}


def commands_in(record):
    """Yield all commands of a record and its parts."""
    for key, value in record.items():
        if key == "command":
            yield value
        elif isinstance(value, dict):
            yield from commands_in(value)


COMMANDS = sorted(
    {
        (file.relative_to(RESULTS).with_suffix("").as_posix(), command)
        for file in RESULTS.rglob("*.json")
        for command in commands_in(json.loads(file.read_text()))
        if command.startswith("python -m ")
    }
)


class Parsed(Exception):
    """The words were taken."""


def module_of(command):
    """Return the name of the module that a command runs."""
    name = command.split()[2]
    spec = find_spec(name)
    assert spec is not None
    return f"{name}.__main__" if spec.submodule_search_locations else name


@pytest.fixture
def parsed(monkeypatch):
    """Let a benchmark read the words of a command, and do nothing else."""
    parse = argparse.ArgumentParser.parse_args

    def parse_args(self, words=None, namespace=None):
        words = list(sys.argv[1:] if words is None else words)
        for action in self._actions:
            if action.required and action.dest in WRITTEN and action.option_strings[0] not in words:
                words += [action.option_strings[0], "somewhere"]
        raise Parsed(parse(self, words, namespace))

    def call(command):
        module = module_of(command)
        with monkeypatch.context() as patched, pytest.raises(Parsed):
            patched.setattr(sys, "argv", [module, *shlex.split(command)[3:]])
            patched.setattr(argparse.ArgumentParser, "parse_args", parse_args)
            importlib.import_module(module).main()

    return call


@pytest.mark.parametrize(("record", "command"), COMMANDS)
def test_a_recorded_command_can_be_given_again(record, command, parsed):
    if record.startswith("history/"):
        importlib.import_module(module_of(command))  # options may have gone since
    elif record in WITHOUT_SETS:
        assert command.endswith(" ...")
    else:
        parsed(command)


def test_folders_are_of_one_machine():
    given = ["fast", "runs/small.onnx", "small=runs/small.onnx@320x240", "--lap", "sets/lap/", "two words", "0.5"]
    assert as_given(given) == "fast small.onnx small=small.onnx@320x240 --lap lap 'two words' 0.5"


class Reader(list):
    name, sha256 = "one-set", "ab" * 32


@pytest.fixture
def recorded(monkeypatch, tmp_path, parsed):
    """Run a benchmark whose measuring is replaced; return the command of its record, which can be given again."""

    def call(module, words):
        view = np.zeros((8, 8, 3), np.uint8)
        monkeypatch.setattr(module, "open_dataset", lambda *where: Reader([SimpleNamespace(left=view, right=view)]))
        file = tmp_path / "found.json"
        monkeypatch.setattr(sys, "argv", ["benchmark", *words, "--json", str(file)])
        module.main()
        (command,) = commands_in(json.loads(file.read_text()))
        parsed(command)
        return command

    return call


def test_models_of_the_picture_are_recorded_as_given(monkeypatch, recorded):
    monkeypatch.setattr(pareto_front, "named_model", lambda entry, threads: (entry.partition("=")[0], "ab" * 32, None))
    monkeypatch.setattr(pareto_front, "measure", lambda methods, samples: {})
    monkeypatch.setattr(pareto_front, "draw", lambda *picture: None)
    given = ["--data", "sets/gi", "--pairs", "1", "--figure", "one.png", "--models"]
    command = recorded(pareto_front, [*given, "fast", "narrow=fast@320x240", "small=runs/small.onnx"])
    assert command.endswith("--models fast narrow=fast@320x240 small=small.onnx")


def test_models_that_saturate_are_recorded_as_given(monkeypatch, recorded):
    metadata = {"endosdk.inference_width": "8", "endosdk.version": "1"}
    meta = SimpleNamespace(get_modelmeta=lambda: SimpleNamespace(custom_metadata_map=metadata))
    monkeypatch.setattr(saturation, "session", lambda *model, fused: meta)
    monkeypatch.setattr(saturation, "read_model", lambda source: SimpleNamespace(data=b"", sha256="ab" * 32))
    monkeypatch.setattr(saturation, "differences", lambda *given: {"mean_px": 0.0, "p99_px": 0.0})
    command = recorded(saturation, ["--data", "gi", "--pairs", "1", "--models", "fast", "before=old/fast.onnx"])
    assert command.endswith("--models fast before=fast.onnx")


def test_weights_are_recorded_as_given(monkeypatch, recorded):
    monkeypatch.setattr(likely_step, "measure", lambda *given: {})
    monkeypatch.setattr(likely_step, "weights_sha256", lambda source: "ab" * 32)
    command = recorded(likely_step, ["--data", "gi", "--weights", "mine=runs/last.safetensors"])
    assert "--weights mine=last.safetensors --dampings" in command


@pytest.mark.parametrize(("study", "more"), [(recipe_gains, []), (clean_teacher, ["--spoilt", "sets/bad"])])
def test_studies_name_their_sets(monkeypatch, parsed, study, more):
    said = []
    monkeypatch.setattr(study, "judging_sets", lambda *given: {})
    monkeypatch.setattr(study, "run_variants", lambda *given: said.append(given[-1]))
    monkeypatch.setattr(clean_teacher, "open_dataset", lambda *where: Reader())
    sets = ["--lap", "sets/lap", "--shapes", "sets/shapes", "--gi", "sets/gi", "--held-out", "sets/a", "sets/b"]
    given = [*sets, "--middlebury", "real/middlebury", *more, "--steps", "3", "--runs", "runs", "--json", "one.json"]
    monkeypatch.setattr(sys, "argv", ["study", *given])
    study.main()
    assert "--gi gi --lap lap --shapes shapes --held-out a b --middlebury middlebury --start fast" in said[0]
    assert "--steps 3" in said[0] and ("--spoilt bad" in said[0]) == bool(more)
    parsed(said[0])
