"""What importing the package brings with it, seen from a fresh interpreter."""

import json
import subprocess
import sys

import endosdk

HEAVY = ("torch", "onnx", "onnxruntime", "cv2", "bpy", "moderngl", "matplotlib", "yaml")


def fresh(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_import_loads_nothing_heavy():
    loaded = json.loads(fresh("import endosdk, sys, json; print(json.dumps(sorted(sys.modules)))"))
    assert not [name for name in HEAVY if name in loaded]


def test_import_is_quick():
    code = "import numpy, time; t = time.process_time(); import endosdk; print(time.process_time() - t)"
    # numpy is the user's own import. Processor time, and the best of three, leave out what else the machine does.
    assert min(float(fresh(code)) for _ in range(3)) < 0.2


def test_import_switches_telemetry_off_before_the_runtime_loads():
    assert fresh("import endosdk, os; print(os.environ['ORT_DISABLE_TELEMETRY'])") == "1"


def test_runtime_never_imports_training_or_simulation():
    code = (
        "import endosdk, endosdk.runtime.estimator, endosdk.jobs.bench, endosdk.commands.cli, sys;"
        "print([m for m in sys.modules if m.startswith(('endosdk.training', 'endosdk.simulation'))])"
    )
    assert fresh(code) == "[]"


def test_training_and_simulation_never_import_each_other():
    # The Blender worker is a program of another environment: nothing here imports it, and here it could not be.
    for ours, theirs in (("training", "simulation"), ("simulation", "training")):
        code = (
            f"import pkgutil, importlib, sys, endosdk.{ours} as p;"
            f"[importlib.import_module(m.name) for m in pkgutil.walk_packages(p.__path__, p.__name__ + '.')"
            f" if not m.name.endswith('.cycles.worker')];"
            f"print([m for m in sys.modules if m.startswith('endosdk.{theirs}')])"
        )
        assert fresh(code) == "[]"


def test_public_names_exist_and_are_few():
    assert all(hasattr(endosdk, name) for name in endosdk.__all__)
    assert dir(endosdk) == sorted(endosdk.__all__)
    assert len(endosdk.__all__) < 12


def test_version_is_the_one_of_the_package_metadata():
    from importlib.metadata import version

    assert endosdk.__version__ == version("endosdk")
