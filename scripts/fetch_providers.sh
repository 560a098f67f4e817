#!/usr/bin/env bash
# Puts accelerated builds of ONNX Runtime that run without an accelerator into folders of their own below the folder
# given: OpenVINO on the processor, and WebGPU on SwiftShader, a Vulkan driver in software, which Debian ships with
# Chromium. Installs nothing into the system and needs no rights.
#
#     scripts/fetch_providers.sh build/providers
#     PYTHONPATH=build/providers/openvino python ...
set -euo pipefail

target=${1:?usage: fetch_providers.sh FOLDER}
python=${PYTHON:-.venv/bin/python}
constraints=$(dirname "$0")/../constraints.txt

for name in openvino webgpu; do
  if [ -d "$target/$name/onnxruntime" ]; then continue; fi
  # What the runtime needs beside itself is in the environment already.
  "$python" -m pip install --quiet --disable-pip-version-check --no-deps --constraint "$constraints" \
    --target "$target/.$name" "onnxruntime-$name"
  mv "$target/.$name" "$target/$name"
done

if [ -f "$target/swiftshader/libvk_swiftshader.so" ]; then exit 0; fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 755 "$work"
fetch() { (cd "$work" && apt-get -qq -o APT::Sandbox::User= download chromium-common); }
fetch || { apt-get -qq update && fetch; }
dpkg-deb -x "$work"/chromium-common_*.deb "$work/package"
mkdir -p "$target/.swiftshader"
for file in libvk_swiftshader.so vk_swiftshader_icd.json libvulkan.so.1; do
  cp "$work/package/usr/lib/chromium/$file" "$target/.swiftshader/"
done
mv "$target/.swiftshader" "$target/swiftshader"
