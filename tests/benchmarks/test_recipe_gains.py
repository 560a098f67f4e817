"""The study of the recipe's gains: each run leaves one part out, and single runs can be asked for."""

import sys

import pytest

from benchmarks.studies import recipe_gains
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig

SETS = ["--lap", "sets/lap", "--shapes", "sets/shapes", "--gi", "sets/gi", "--held-out", "sets/a"]
GIVEN = ["study", *SETS, "--middlebury", "real/middlebury", "--runs", "runs", "--json", "one.json"]


@pytest.fixture
def asked(monkeypatch):
    """Return the settings of the runs that the study starts, by name, and the command that it records."""
    started = []
    monkeypatch.setattr(recipe_gains, "judging_sets", lambda *given: {})
    monkeypatch.setattr(recipe_gains, "run_variants", lambda *given: started.append(given))

    def call(*words):
        monkeypatch.setattr(sys, "argv", [*GIVEN, *words])
        recipe_gains.main()
        _, _, given, runs, command = started.pop()
        recipe = {**checkpoint.inherited("fast", given), **given}
        return {name: TrainConfig.from_dict({**recipe, **run.changes}) for name, run in runs.items()}, command

    return call


def test_each_run_differs_from_the_whole_recipe_in_one_part(asked):
    configs, _ = asked()
    plain = configs.pop("whole recipe").as_dict()
    assert plain["mode_reach"] == 2 and "rows" in plain["looks"]
    changed = {
        name: {key for key, value in config.as_dict().items() if value != plain[key]}
        for name, config in configs.items()
    }
    assert changed == {
        "whole recipe, another seed": {"seed"},
        "without looks of light and lens": {"looks"},
        "without rows that differ": {"looks"},
        "without cross-entropy of the volume": {"volume_weight"},
        "without scenes of mere objects": {"data"},
        "with a full soft-argmin": {"mode_reach"},
    }
    assert configs["with a full soft-argmin"].mode_reach is None
    assert set(plain["looks"]) - set(configs["without rows that differ"].looks) == {"rows"}


def test_single_runs_can_be_asked_for(asked, capsys):
    names = ("whole recipe", "with a full soft-argmin")
    configs, command = asked("--only", *names)
    assert tuple(configs) == names
    assert "--only 'whole recipe' 'with a full soft-argmin'" in command
    with pytest.raises(SystemExit):
        asked("--only", "whole recipe", "half of it")
    assert "--only: no runs of these names: half of it" in capsys.readouterr().err
