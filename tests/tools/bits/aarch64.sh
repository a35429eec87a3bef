#!/usr/bin/env bash
# Compare the hashes of shipped scenarios on an emulated aarch64: tests/tools/bits/aarch64.sh [SCENARIO …]
# On Debian, as root: apt-get install qemu-user-static debootstrap. Without binfmt: one program is run, the interpreter.
# FOLDER (.bits-aarch64) keeps 2 GB: Debian for arm64, wheels and kernels. The first run compiles for half an hour.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../../.."
folder=$(realpath -m "${FOLDER:-.bits-aarch64}")
root=$folder/root site=$folder/site
mkdir -p "$folder"

if [ ! -e "$root/usr/bin/python3.11" ]; then
    debootstrap --arch=arm64 --foreign --variant=minbase --include=python3,libstdc++6 bookworm "$root"
    for package in "$root"/var/cache/apt/archives/*.deb; do dpkg -x "$package" "$root"; done
fi
if [ ! -d "$site/numpy" ]; then
    .ci/uv export --quiet --no-emit-workspace --no-hashes >"$folder/requirements.txt"
    .ci/uv pip install --no-deps --only-binary :all: --python-version 3.11 --python-platform aarch64-manylinux_2_28 \
        --target "$site" -r "$folder/requirements.txt"
fi
# Our own packages anew each time, with the metadata that run.json names versions by.
rm -rf "$folder/wheels" "$folder/own"
.ci/uv build --quiet --all-packages --wheel --out-dir "$folder/wheels"
.ci/uv pip install --quiet --no-deps --python-version 3.11 --python-platform aarch64-manylinux_2_28 --target "$folder/own" "$folder"/wheels/*.whl

NUMBA_CACHE_DIR=$folder/kernels PYTHONPATH=$folder/own:$site:. \
    qemu-aarch64-static -L "$root" "$root/usr/bin/python3.11" -m tests.tools.bits "$@"
