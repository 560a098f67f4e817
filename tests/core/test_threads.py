"""The shared worker threads, the choice of instruction set, and the module's own face."""

from __future__ import annotations

import ast
import enum
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import endosdk
from endosdk import _core
from tests.core_rigs import ISAS

pytestmark = pytest.mark.usefixtures("restored_settings")

STUB = Path(endosdk.__file__).parent / "_core.pyi"


def enlarge(source: np.ndarray) -> np.ndarray:
    out = np.zeros((source.shape[0] * 8, source.shape[1] * 8), np.float32)
    _core.resize_bilinear(source, out, 1 / 8, 1 / 8, 1.0)
    return out


SOURCE = np.random.default_rng(0).random((90, 120)).astype(np.float32)


def run_python(program: str) -> str:
    return subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout


def native_threads() -> int:
    return len(list(Path("/proc/self/task").iterdir()))


def test_default_is_the_cores_of_this_process() -> None:
    program = "from endosdk import _core; assert _core.threads() == _core.default_threads(); print(_core.threads())"
    assert int(run_python(program)) == min(len(os.sched_getaffinity(0)), 8)
    alone = f"import os; os.sched_setaffinity(0, [{min(os.sched_getaffinity(0))}]); {program}"
    assert int(run_python(alone)) == 1


def test_importing_starts_no_thread_and_work_starts_only_what_it_needs() -> None:
    program = """
import os, numpy as np
os.environ["OPENBLAS_NUM_THREADS"] = "1"
from endosdk import _core
count = lambda: len(os.listdir("/proc/self/task"))
before = count()
_core.set_threads(3)
assert count() == before
out = np.zeros((720, 960), np.float32)
for _ in range(3):
    _core.resize_bilinear(np.ones((90, 120), np.float32), out, 1 / 8, 1 / 8, 1.0)
    assert count() == before + 2
_core.set_threads(2)
_core.resize_bilinear(np.ones((90, 120), np.float32), out, 1 / 8, 1 / 8, 1.0)
assert count() == before + 2
"""
    run_python(program)


@pytest.mark.parametrize("threads", [1, 2, 3, 7, 256])
def test_any_number_of_threads_gives_the_same_answer(threads: int) -> None:
    _core.set_threads(1)
    expected = enlarge(SOURCE)
    _core.set_threads(threads)
    assert _core.threads() == threads
    for _ in range(5):
        np.testing.assert_array_equal(enlarge(SOURCE), expected)


@pytest.mark.parametrize("count", [0, -1, 257])
def test_an_impossible_number_of_threads_is_refused(count: int) -> None:
    _core.set_threads(2)
    with pytest.raises(ValueError, match=f"threads: must be 1 to 256; got {count}"):
        _core.set_threads(count)
    assert _core.threads() == 2


def test_callers_with_different_numbers_of_threads() -> None:
    expected = enlarge(SOURCE)

    def enlarge_with(threads: int) -> np.ndarray:
        _core.set_threads(threads)
        return enlarge(SOURCE)

    with ThreadPoolExecutor(3) as callers:
        for result in callers.map(enlarge_with, [1, 2, 3, 4, 5] * 30):
            np.testing.assert_array_equal(result, expected)


def test_each_thread_has_a_number_of_its_own() -> None:
    _core.set_threads(3)
    with ThreadPoolExecutor(1) as other:
        assert other.submit(_core.threads).result() == _core.default_threads()
        other.submit(_core.set_threads, 5).result()
        assert other.submit(_core.threads).result() == 5
    assert _core.threads() == 3


def test_the_interpreter_runs_on_while_kernels_work() -> None:
    # A thread that only needs the interpreter's lock must make progress during one long call.
    big = np.random.default_rng(0).random((700, 900)).astype(np.float32)
    _core.set_threads(1)
    ticks = 0
    stop = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not stop.wait(0.001):
            ticks += 1

    ticker = threading.Thread(target=tick)
    ticker.start()
    out = np.zeros((7000, 9000), np.float32)
    before = ticks
    _core.resize_bilinear(big, out, 0.1, 0.1, 1.0)
    during = ticks - before
    stop.set()
    ticker.join()
    assert during >= 3


def test_a_forked_child_has_workers_of_its_own() -> None:
    program = """
import os, numpy as np
from endosdk import _core
_core.set_threads(3)
source = np.random.default_rng(0).random((90, 120)).astype(np.float32)
def enlarge():
    out = np.zeros((720, 960), np.float32)
    _core.resize_bilinear(source, out, 1 / 8, 1 / 8, 1.0)
    return out
expected = enlarge()
child = os.fork()
if child == 0:
    ok = _core.threads() == 3 and (enlarge() == expected).all() and len(os.listdir("/proc/self/task")) >= 3
    os._exit(0 if ok else 1)
_, status = os.waitpid(child, 0)
assert os.waitstatus_to_exitcode(status) == 0
assert (enlarge() == expected).all()
"""
    run_python(program)


def test_sleeping_workers_use_no_processor_time() -> None:
    _core.set_threads(4)
    enlarge(SOURCE)
    program_seconds = os.times()
    threading.Event().wait(0.5)
    after = os.times()
    assert (after.user + after.system) - (program_seconds.user + program_seconds.system) < 0.1


def test_instruction_sets() -> None:
    assert "plain" in ISAS
    for name in ISAS:
        _core.set_isa(name)
        assert _core.isa() == name
    with pytest.raises(ValueError, match=r"isa: must be one that this processor runs \(.*plain\); got sse9"):
        _core.set_isa("sse9")
    assert _core.isa() == ISAS[-1]


def test_version_is_the_package_version() -> None:
    from importlib.metadata import version

    assert _core.version == version("endosdk")


def names_of(body: list[ast.stmt]) -> set[str]:
    names = {node.name for node in body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return names | {
        node.target.id for node in body if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }


def public(names: list[str]) -> set[str]:
    return {name for name in names if not name.startswith("_")}


def test_the_stub_names_everything_in_the_module() -> None:
    body = ast.parse(STUB.read_text()).body
    assert public(sorted(names_of(body))) == public(dir(_core))
    for node in body:
        if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):  # a type that only the stub knows
            continue
        kind = getattr(_core, node.name)
        if issubclass(kind, enum.Enum):
            assert ast.literal_eval(ast.Dict(*numbers_of(node.body))) == dict(kind.__members__)
        else:
            assert public(sorted(names_of(node.body))) == public(dir(kind))


def numbers_of(body: list[ast.stmt]) -> tuple[list[ast.expr], list[ast.expr]]:
    """Names and numbers of an enum's members."""
    members = [node for node in body if isinstance(node, ast.Assign)]
    return [ast.Constant(ast.unparse(node.targets[0])) for node in members], [node.value for node in members]


def test_the_stub_has_the_module_s_argument_names() -> None:
    body = ast.parse(STUB.read_text()).body
    functions = [node for node in body if isinstance(node, ast.FunctionDef) and node.args.args]
    assert functions
    for node in functions:
        signature = getattr(_core, node.name).__doc__.splitlines()[0]
        arguments = signature[signature.index("(") + 1 :]
        for argument in node.args.args:
            assert f"{argument.arg}: " in arguments, (node.name, argument.arg)
