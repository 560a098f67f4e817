#!/usr/bin/env bash
# Compiles every source of the C library for macOS on ARM and for Windows on x86-64, with the clang and the headers that Zig
# brings. Nothing is linked and nothing is run: this finds what another system's headers or standard library do not have.
set -euo pipefail
cd "$(dirname "$0")/.."

PATH=$PATH:$PWD/.venv/bin
unset CMAKE_CXX_COMPILER_LAUNCHER  # a compiler cache does not know this compiler
locked=$(awk '/^ziglang==/,!/\\$/' constraints-build.txt)
folder=$PWD/build/${locked%% *}
if [ ! -d "$folder" ]; then
  .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps --no-compile --target "$folder.new" \
    --require-hashes --requirement <(echo "$locked")
  mv "$folder.new" "$folder"
fi
zig=$folder/ziglang/zig headers=$folder/ziglang/lib
# Zig's own driver would first build a whole standard library for each system, to link with. Its headers are enough here, with
# the settings that this driver passes.
settings=(HARDENING_MODE=_LIBCPP_HARDENING_MODE_NONE ASSERTION_SEMANTIC_DEFAULT=_LIBCPP_ASSERTION_SEMANTIC_IGNORE
  ABI_VERSION=1 ABI_NAMESPACE=__1 PSTL_BACKEND_SERIAL HAS_MUSL_LIBC=0 HAS_VENDOR_AVAILABILITY_ANNOTATIONS=0
  HAS_{THREADS,MONOTONIC_CLOCK,TERMINAL,FILESYSTEM,RANDOM_DEVICE,LOCALIZATION,UNICODE,WIDE_CHARACTERS})

# compile SYSTEM PROCESSOR TARGET FOLDER...: the folders hold the headers of this system, below those of all.
compile() {
  local build=$PWD/build/compiled-$1 system=$1 processor=$2 target=$3 mode
  shift 3
  mkdir -p "$build"
  for mode in gcc g++; do
    {
      echo '#!/bin/sh'
      printf 'exec "%s" clang --driver-mode=%s --target=%s -nostdinc -Qunused-arguments' "$zig" $mode "$target"
      [ $mode = gcc ] || printf ' -isystem "%s"' "$headers"/{libcxx,libcxxabi}/include
      printf ' -isystem "%s"' "$headers/include" "${@/#/$headers/libc/include/}"
      [ $mode = gcc ] || printf ' -D_LIBCPP_%s' "${settings[@]}"
      echo ' "$@"'
    } > "$build/zig-$mode"
    chmod +x "$build/zig-$mode"
  done
  cmake -S . -B "$build" -G Ninja -DCMAKE_SYSTEM_NAME="$system" -DCMAKE_SYSTEM_PROCESSOR="$processor" \
    -DCMAKE_C_COMPILER="$build/zig-gcc" -DCMAKE_CXX_COMPILER="$build/zig-g++" -DCMAKE_TRY_COMPILE_TARGET_TYPE=STATIC_LIBRARY \
    -DCMAKE_INSTALL_NAME_TOOL=no-link-here -DCMAKE_BUILD_TYPE=None -DENDOSDK_PRECOMPILE=ON > /dev/null
  cmake --build "$build" --target endosdk_core endosdk_objects
  echo "$system: every source of the library compiles"
}

compile Darwin arm64 arm64-apple-macosx13 any-darwin-any
compile Windows AMD64 x86_64-w64-windows-gnu x86_64-windows-gnu generic-mingw x86_64-windows-any any-windows-any
