#!/usr/bin/env bash
# Builds libendosdk and its tests for 64-bit ARM and runs them in an emulator. The NEON kernels must give the bytes of the
# plain ones and of this processor's kernels, which the Python tests compare with their NumPy twins. Models run in the ONNX
# Runtime for ARM from PyPI. A shipped 8-bit model must give the depth that it gives here, on a processor with dot products and on
# one without.
set -euo pipefail
cd "$(dirname "$0")/.."

for tool in aarch64-linux-gnu-g++ qemu-aarch64; do
  command -v $tool > /dev/null && continue
  echo "ARM tests are skipped: no $tool (Debian: apt-get install g++-aarch64-linux-gnu qemu-user)"
  exit 77  # what lacks a tool was not run: not the same as passed
done

PATH=$PATH:$PWD/.venv/bin
arm=build/aarch64
runtime=$(realpath "$(scripts/fetch_onnxruntime.sh manylinux_2_28_aarch64 build/runtimes)")
units="calibration kernel_bytes kernels pose_filter threads"
library="library_header library_maps library_models library_units"
cmake -S . -B $arm -G Ninja -DCMAKE_TOOLCHAIN_FILE=cmake/aarch64-linux-gnu.cmake -DENDOSDK_BUILD_TESTS=ON -DENDOSDK_BUILD_EXAMPLES=ON \
  -DENDOSDK_PRECOMPILE=ON -DENDOSDK_TEST_RUNTIME="$runtime" > /dev/null
# shellcheck disable=SC2086  # lists
cmake --build $arm --target depth_cli $(printf 'test_%s ' $units) $library
tests=$(echo $units $library | tr ' ' '|')
ctest --test-dir $arm --output-on-failure --no-tests=error -R "^($tests)\$"

here=$(scripts/kernel_bytes.sh)
diff <($here) <(qemu-aarch64 -L /usr/aarch64-linux-gnu $arm/cpp/tests/test_kernel_bytes)
echo "every kernel gives the same bytes on ARM as here"

.venv/bin/python - $arm "$runtime" << 'END'
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

import endosdk
from endosdk.io.pictures import read_frame

arm, runtime = Path(sys.argv[1]), sys.argv[2]
data = Path("examples/data")
pair = [read_frame(data / "demo" / f"{side}.png") for side in ("left", "right")]
with endosdk.DepthEstimator("fast-320", calibration=endosdk.StereoCalibration.load(data / "rig.json")) as estimator:
    here = estimator.predict(*pair).depth
views = [arm / f"{side}.ppm" for side in ("left", "right")]
for file, view in zip(views, pair, strict=True):
    cv2.imwrite(str(file), view[..., ::-1])
for processor in ("neoverse-n1", "cortex-a72"):
    emulated = ["qemu-aarch64", "-cpu", processor, "-L", arm / "system", "-E", f"ENDOSDK_ORT_LIBRARY={runtime}"]
    program = [arm / "cpp" / "examples" / "depth_cli", "models/fast-320.onnx", *views, arm / "depth.pgm", data / "rig.json"]
    subprocess.run([*emulated, *program], check=True, env={**os.environ, "ORT_DISABLE_TELEMETRY": "1"})
    there = cv2.imread(str(arm / "depth.pgm"), cv2.IMREAD_UNCHANGED) / 10
    valid = np.isfinite(here), there > 0
    apart = (np.abs(there - here) / here)[valid[0] & valid[1]]
    most, only_one = np.quantile(apart, 0.99), np.mean(valid[0] != valid[1])
    print(f"{processor}: 99 % of the depths differ by {100 * most:.2f} % at most, {100 * only_one:.2f} % are in one map only")
    assert most < 0.01 and only_one < 0.01
END
