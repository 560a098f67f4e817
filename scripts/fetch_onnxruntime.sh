#!/usr/bin/env bash
# Puts the ONNX Runtime of another system, in the version of release builds, into the folder given, and prints the path of its
# library. It comes from PyPI, with its hash checked.
#
#     scripts/fetch_onnxruntime.sh manylinux_2_28_aarch64 FOLDER
set -euo pipefail

platform=${1:?usage: fetch_onnxruntime.sh PLATFORM FOLDER} target=${2:?usage: fetch_onnxruntime.sh PLATFORM FOLDER}
root=$(dirname "$0")/..
wanted=$(awk '/^onnxruntime==/,!/\\$/' "$root/constraints-release.txt")
version=${wanted%% *}
folder=$target/$platform-${version#*==}
if [ ! -d "$folder" ]; then
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  python=$root/.venv/bin/python
  "$python" -m pip download --quiet --disable-pip-version-check --no-deps --only-binary :all: --dest "$work" \
    --platform "$platform" --python-version 3.12 --require-hashes --requirement <(echo "$wanted") >&2
  "$python" -m zipfile --extract "$work"/onnxruntime-*.whl "$work"
  mkdir -p "$folder.new"
  mv "$work"/onnxruntime/capi/*onnxruntime.* "$folder.new/"
  mv "$folder.new" "$folder"
fi
ls "$folder"/*onnxruntime.*
