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


# What hosts keep in logs and compare with. A new one is appended; none of these ever changes.
CODES = {
    "OK": 0,
    "INVALID_ARGUMENT": 1,
    "INVALID_CALIBRATION": 2,
    "CALIBRATION_REQUIRED": 3,
    "CALIBRATION_SIZE_MISMATCH": 4,
    "CALIBRATION_UNREADABLE": 5,
    "MODEL_NOT_FOUND": 6,
    "MODEL_UNREADABLE": 7,
    "MODEL_METADATA": 8,
    "MODEL_HASH_MISMATCH": 9,
    "RUNTIME_MISSING": 10,
    "RUNTIME_CONFLICT": 11,
    "PROVIDER_UNAVAILABLE": 12,
    "INFERENCE_FAILED": 13,
    "DATASET_INVALID": 14,
    "DEPENDENCY_MISSING": 15,
    "RENDERER_UNAVAILABLE": 16,
    "STORAGE_FAILED": 17,
    "CANCELLED": 18,
    "OUT_OF_MEMORY": 19,
    "SELF_TEST_FAILED": 20,
    "INTERNAL": 21,
    "SOURCE_FAILED": 22,
    "RUNTIME_HASH_MISMATCH": 23,
}


def test_every_code_keeps_its_number():
    assert {name: int(code) for name, code in errors.ErrorCode.__members__.items()} == CODES


def test_memory_that_is_used_up_is_said_in_the_words_of_c():
    error = errors.error_of(errors.ErrorCode.OUT_OF_MEMORY, "", "out of memory", "")
    assert isinstance(error, MemoryError) and str(error) == "out of memory [OUT_OF_MEMORY]"
