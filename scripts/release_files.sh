#!/usr/bin/env bash
# Builds the files of a release for every Linux with glibc 2.28 or later: the wheel, the tarball and the Debian package.
# The compiler is Zig's clang from PyPI, which links against any release of glibc. The tools are those of constraints-build.txt,
# by their hashes. All is built twice, of two folders and without a common cache, and must be the same bytes. The wheel is
# audited, installed into an empty environment and asked for a depth map. The C library of the Debian package is asked by its
# example. The papers of the release must be those of its components.
#
#     scripts/release_files.sh [FOLDER]       default: build/release-files; release files that lie there are removed
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(realpath -m "${1:-build/release-files}")
glibc=2.28
export ORT_DISABLE_TELEMETRY=1
mkdir -p "$out"
rm -rf "$out"/{raw,packages,again} "$out"/endosdk-*.whl  # those of an earlier version would be taken for this one's
[ -z "$(git status --porcelain)" ] || { echo "the checkout has changes: a release is built of a commit" >&2; exit 1; }

# install FOLDER LIST...: a virtual environment of what is locked.
install() {
  local folder=$1 lists=()
  shift
  [ -x "$folder/bin/pip" ] || python3 -m venv "$folder"
  for list in "$@"; do lists+=(-r "constraints-$list.txt"); done
  "$folder/bin/pip" install --quiet --disable-pip-version-check --require-hashes "${lists[@]}"
}
install "$out/papers" papers
"$out/papers/bin/python" scripts/device_papers.py --check
# What is compiled in, and what builds, in the versions that the papers of the release state.
tools=$out/tools
install "$tools" release build
for language in cc c++; do
  printf '#!/bin/sh\nunset PYTHONPATH\nexec "%s" -m ziglang %s -target x86_64-linux-gnu.%s "$@"\n' "$tools/bin/python" $language $glibc > "$tools/zig-$language"
  chmod +x "$tools/zig-$language"
done
export CC=$tools/zig-cc CXX=$tools/zig-c++ PATH=$tools/bin:$PATH

# build FROM TO: the wheel and the packages of the library.
build() {
  local from=$1 to=$2
  (
    cd "$from"
    pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --config-settings=build-dir="$to/python" \
      --wheel-dir "$to/raw" .
    cmake -S . -B "$to/library" -G Ninja -DENDOSDK_BUILD_EXAMPLES=ON > /dev/null
    cmake --build "$to/library"
    cpack --config "$to/library/CPackConfig.cmake" -B "$to/packages" > /dev/null
  )
}
# unpacked FOLDER: what is in its packages, whose own files state the time of packing.
unpacked() {
  mkdir -p "$1/unpacked"/{tarball,deb}
  tar --extract --gzip --file "$1"/packages/*.tar.gz --directory "$1/unpacked/tarball"
  dpkg-deb --extract "$1"/packages/*.deb "$1/unpacked/deb"
}
build "$PWD" "$out"
git clone --quiet . "$out/again/source"
ZIG_GLOBAL_CACHE_DIR=$out/again/cache build "$out/again/source" "$out/again"
cmp "$out"/raw/endosdk-*.whl "$out"/again/raw/endosdk-*.whl
rm -rf "$out/unpacked"
unpacked "$out"
unpacked "$out/again"
diff --recursive "$out/unpacked" "$out/again/unpacked"
echo "two builds are the same bytes"

auditwheel repair --plat manylinux_${glibc/./_}_x86_64 --wheel-dir "$out" "$out"/raw/endosdk-*.whl
wheel=$(ls "$out"/endosdk-*manylinux*.whl)

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
