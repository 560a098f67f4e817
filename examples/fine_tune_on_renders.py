"""Render pairs for your rig, fine-tune `fast` on them, export the model, and print the error before and after.

python examples/fine_tune_on_renders.py RIG OUT_DIR [PAIRS [STEPS]]

Begin with about 500 pairs and 5,000 steps. The defaults are small: they only show that every step works. The script
stops if a step fails.
"""

import json
import subprocess
import sys
from pathlib import Path

import endosdk

rig_file, out = sys.argv[1], Path(sys.argv[2])
pairs, steps = (sys.argv[3:] + ["20", "100"][len(sys.argv) - 3 :])[:2]
view = endosdk.StereoCalibration.load(rig_file).rectification()
data, run, model = out / "renders", out / "run", out / "tuned.onnx"


def endosdk_verb(*words: object) -> str:
    program = [sys.executable, "-m", "endosdk", *map(str, words)]
    return subprocess.run(program, check=True, stdout=subprocess.PIPE, text=True).stdout


def error_px(name: object) -> float:
    return json.loads(endosdk_verb("evaluate", "--model", name, "--data", data, "--json"))["scores"]["all"]["epe_px"]


size = "--width", view.width, "--height", view.height, "--focal", view.focal_px, "--baseline", view.baseline_mm
few = "--pairs", pairs, "--test-pairs", max(2, int(pairs) // 10)
endosdk_verb("simulate", "--organ", "mix", "--out", data, "--max-disparity", view.width // 4, *size, *few)
endosdk_verb("train", "--data", data, "--init-from", "fast", "--steps", steps, "--held-out", 2, "--out", run)
endosdk_verb("export", run, "--out", model, "--name", "tuned", "--data", data)
print(f"test pairs: {error_px('fast-fp32'):.3f} px before, {error_px(model):.3f} px after")
