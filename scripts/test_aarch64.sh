#!/usr/bin/env bash
# Builds libendosdk and its tests for 64-bit ARM and runs them in an emulator. The NEON kernels must give the bytes of the
# plain ones and of this processor's kernels, which the Python tests compare with their NumPy twins.
set -euo pipefail
cd "$(dirname "$0")/.."

for tool in aarch64-linux-gnu-g++ qemu-aarch64; do
  command -v $tool > /dev/null && continue
  echo "ARM tests are skipped: no $tool (Debian: apt-get install g++-aarch64-linux-gnu qemu-user)"
  exit 77  # what lacks a tool was not run: not the same as passed
done

PATH=$PATH:$PWD/.venv/bin
arm=build/aarch64
cmake -S . -B $arm -G Ninja -DCMAKE_TOOLCHAIN_FILE=cmake/aarch64-linux-gnu.cmake -DENDOSDK_BUILD_TESTS=ON -DENDOSDK_PRECOMPILE=ON > /dev/null
cmake --build $arm --target endosdk test_kernel_bytes test_kernels test_calibration test_pose_filter test_threads library_header library_units
ctest --test-dir $arm --output-on-failure --no-tests=error -R '^(kernel_bytes|kernels|calibration|pose_filter|threads|library_header|library_units)$'

here=$(scripts/kernel_bytes.sh)
diff <($here) <(qemu-aarch64 -L /usr/aarch64-linux-gnu $arm/cpp/tests/test_kernel_bytes)
echo "every kernel gives the same bytes on ARM as here"
