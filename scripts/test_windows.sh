#!/usr/bin/env bash
# Builds libendosdk and its tests for Windows with MinGW-w64, and runs them in Wine with the onnxruntime.dll of the
# package on PyPI. The kernels must give the bytes that they give here.
#
#     scripts/test_windows.sh            builds and runs what does not need ONNX Runtime
#     scripts/test_windows.sh FOLDER     and runs models, with FOLDER/onnxruntime.dll; fetched by pip where it is missing
set -euo pipefail
cd "$(dirname "$0")/.."

for tool in x86_64-w64-mingw32-g++-posix wine; do
  command -v $tool > /dev/null && continue
  echo "Windows tests are skipped: no $tool (Debian: apt-get install g++-mingw-w64-x86-64 wine64 wine)"
  exit 77  # what lacks a tool was not run: not the same as passed
done

PATH=$PATH:$PWD/.venv/bin
windows=build/windows
export WINEDEBUG=-all WINEPREFIX=$PWD/build/wine
runtime=${1:-}
if [ -n "$runtime" ] && [ ! -f "$runtime/onnxruntime.dll" ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  .venv/bin/python -m pip download --quiet --disable-pip-version-check --no-deps --only-binary :all: --dest "$work" \
    --platform win_amd64 --python-version 3.12 onnxruntime==1.24.4
  mkdir -p "$runtime"
  .venv/bin/python -c 'import sys, zipfile; zipfile.ZipFile(sys.argv[1]).extract("onnxruntime/capi/onnxruntime.dll", sys.argv[2])' \
    "$work"/onnxruntime-*.whl "$work"
  mv "$work/onnxruntime/capi/onnxruntime.dll" "$runtime/"
fi

cmake -S . -B $windows -G Ninja -DCMAKE_TOOLCHAIN_FILE=cmake/x86_64-w64-mingw32.cmake -DENDOSDK_BUILD_TESTS=ON > /dev/null
parts="kernel_bytes kernels calibration pose_filter threads library_header library_units"
models="library_maps library_models library_streams"
cmake --build $windows --target endosdk $(printf 'test_%s ' kernel_bytes kernels calibration pose_filter threads) library_header \
  library_units $models
# A program finds the library in its own folder.
cp $windows/cpp/libendosdk.dll $windows/cpp/tests/library/
for part in $parts; do
  program=$(find $windows/cpp/tests -name "$part.exe" -o -name "test_$part.exe")
  wine "$program" > $windows/$part.log
  echo "$part: passed"
done
here=$(scripts/kernel_bytes.sh)
diff <($here) <(tr -d '\r' < $windows/kernel_bytes.log)
echo "every kernel gives the same bytes on Windows as here"
if [ -n "$runtime" ]; then
  for part in $models; do
    wine "$windows/cpp/tests/library/$part.exe" "$runtime/onnxruntime.dll" models/tiny-for-tests.onnx
    echo "$part: passed"
  done
fi
