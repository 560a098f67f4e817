#!/usr/bin/env bash
# Prints the path of this machine's program that writes what every kernel gives. `make test` has built it; elsewhere it is
# built now. Scripts for other systems compare theirs with it.
set -euo pipefail
cd "$(dirname "$0")/.."

program=build/release/cpp/tests/test_kernel_bytes
[ -x $program ] || {
  cmake -S . -B build/release -G Ninja -DENDOSDK_BUILD_TESTS=ON > /dev/null
  cmake --build build/release --target test_kernel_bytes > /dev/null
}
echo $program
