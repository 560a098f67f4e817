#!/usr/bin/env bash
# Prints the path of this machine's program that writes what every kernel gives. It is built where it is not up to date.
# Scripts for other systems compare theirs with it.
set -euo pipefail
cd "$(dirname "$0")/.."

build=build/release
[ -f $build/build.ninja ] || cmake -S . -B $build -G Ninja -DENDOSDK_BUILD_TESTS=ON >&2
cmake --build $build --target test_kernel_bytes >&2
echo $build/cpp/tests/test_kernel_bytes
