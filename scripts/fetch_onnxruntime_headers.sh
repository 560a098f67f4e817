#!/usr/bin/env bash
# Puts ONNX Runtime's C header into the folder given, from Debian's own package; installs nothing and needs no rights.
#
# Debian 12 has no package of these headers, so the next release's is downloaded through apt, from the mirror this
# machine already uses and with apt's signature checks, into private lists. On other systems pass
# -DONNXRUNTIME_INCLUDE_DIR=<folder with onnxruntime_c_api.h>, version 1.21 or later, to CMake instead.
set -euo pipefail

suite=trixie
# Of the header itself, so that it holds for every architecture's package.
expected=7783e9664bdb0b1b36145b5c8587dd1bc9a399aa000edf2e3dd03003cafc6882

target=${1:?usage: fetch_onnxruntime_headers.sh FOLDER}
if [ -f "$target/onnxruntime_c_api.h" ]; then exit 0; fi
command -v apt-get > /dev/null || { echo "no apt-get here: pass -DONNXRUNTIME_INCLUDE_DIR instead" >&2; exit 1; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/lists/partial" "$work/cache/archives/partial" "$work/package"

# The first Debian source of this machine, with only the suite replaced.
eval "$(apt-config shell parts Dir::Etc::sourceparts/d list Dir::Etc::sourcelist/f)"
if [ -f "$parts/debian.sources" ]; then
  awk 'BEGIN { RS = ""; ORS = "\n\n" } NR == 1' "$parts/debian.sources" | sed "s/^Suites:.*/Suites: $suite/" \
    > "$work/source.sources"
else
  awk -v suite="$suite" '$1 == "deb" && / main/ { for (i = 2; i < NF; i++) if ($i ~ /:\/\//) $(i + 1) = suite; print; exit }' \
    "$list" > "$work/source.list"
fi
options=(-qq -o "Dir::Etc::sourcelist=$(ls "$work"/source.*)" -o Dir::Etc::sourceparts=-
  -o "Dir::State::lists=$work/lists" -o "Dir::Cache=$work/cache" -o APT::Get::List-Cleanup=0 -o APT::Sandbox::User=)
apt-get "${options[@]}" update
(cd "$work" && apt-get "${options[@]}" download libonnxruntime-dev)
dpkg -x "$work"/libonnxruntime-dev_*.deb "$work/package"

headers=$work/package/usr/include/onnxruntime
echo "$expected  $headers/onnxruntime_c_api.h" | sha256sum --check --quiet -
mkdir -p "$target"
# Moved last and at once, so that a header in place is a whole one.
cp "$headers/onnxruntime_c_api.h" "$target/.new"
mv "$target/.new" "$target/onnxruntime_c_api.h"
