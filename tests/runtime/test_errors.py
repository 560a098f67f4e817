import pickle

import pytest

from endosdk import errors

CLASSES = [c for c in vars(errors).values() if isinstance(c, type) and issubclass(c, errors.EndoError)]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda c: c.__name__)
def test_message_names_argument_rule_value_and_code(cls):
    error = cls("left", "must be uint8", "float64")
    assert str(error) == f"left: must be uint8; got float64 [{cls.code.name}]"
    assert (error.argument, error.rule, error.value) == ("left", "must be uint8", "float64")


@pytest.mark.parametrize("cls", CLASSES, ids=lambda c: c.__name__)
def test_crosses_a_process_boundary_whole(cls):
    error = pickle.loads(pickle.dumps(cls("left", "must be uint8", "float64")))
    assert type(error) is cls
    assert error.code is cls.code
    assert error.value == "float64"


def test_every_error_is_also_a_builtin_kind():
    builtins = (ValueError, RuntimeError, ImportError, OSError, MemoryError)
    assert all(issubclass(c, builtins) for c in CLASSES if c is not errors.EndoError)


def test_codes_are_unique_numbers():
    numbers = [int(code) for code in errors.ErrorCode]
    assert len(set(numbers)) == len(numbers)
    assert numbers == sorted(numbers)


def test_memory_that_is_used_up_is_said_in_the_words_of_c():
    error = errors.error_of(errors.ErrorCode.OUT_OF_MEMORY, "", "out of memory", "")
    assert isinstance(error, MemoryError) and str(error) == "out of memory [OUT_OF_MEMORY]"
