#!/usr/bin/env bash
# Static analysis of the C and C++ sources by the checks of .clang-tidy, each of which they pass: one finding fails.
#
#     scripts/clang_tidy.sh            all sources of the library
#     scripts/clang_tidy.sh FILE...    some
set -euo pipefail
cd "$(dirname "$0")/.."

PATH=$PATH:$PWD/.venv/bin
tidy=$PWD/.venv/bin/clang-tidy  # of a kind with the list of checks: each version has its own
[ -x "$tidy" ] || {
  echo "static analysis is skipped: no clang-tidy (make .venv/.develop)"
  exit 77  # what lacks a tool was not run: not the same as passed
}
build=build/analysed
cmake -S . -B $build -G Ninja -DENDOSDK_BUILD_EXAMPLES=ON > /dev/null
cmake --build $build --target endosdk_build_info > /dev/null
if [ $# -eq 0 ]; then
  # Kernels are written in intrinsics of one processor each; every set is compared byte for byte with the plain one.
  mapfile -t files < <(find cpp/src cpp/examples -name '*.cpp' -o -name '*.c' | grep -v -e /kernels/ -e system_windows | sort)
else
  files=("$@")
fi
printf '%s\n' "${files[@]}" | xargs -P "${JOBS:-$(nproc)}" -n 4 "$tidy" --quiet -p $build
echo "${#files[@]} files: no finding"
