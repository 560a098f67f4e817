"""Spoilt files of every kind that is read: an answer or a typed error, and never the end of the process."""

import os
import warnings

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from endosdk.errors import EndoError
from tests.hardening.targets import TARGETS, spoilt

QUICK, THOROUGH = 40, 2000


def attack(name: str, examples: int, *, derandomize: bool) -> None:
    target = TARGETS[name]
    target.try_bytes(target.seed())  # the unspoilt one is read

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=derandomize,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.data())
    def one(data: st.DataObject) -> None:
        content = data.draw(spoilt(target.seed()))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                target.try_bytes(content)
        except EndoError as error:
            assert error.code.name in str(error)

    one()


@pytest.mark.parametrize("name", TARGETS)
def test_spoilt_files_give_typed_errors(name: str) -> None:
    attack(name, QUICK, derandomize=True)


@pytest.mark.skipif("ENDOSDK_THOROUGH" not in os.environ, reason="takes many minutes: set ENDOSDK_THOROUGH=1")
@pytest.mark.parametrize("name", TARGETS)
def test_many_spoilt_files_give_typed_errors(name: str) -> None:
    attack(name, THOROUGH, derandomize=False)
