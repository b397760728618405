#!/usr/bin/env bash
# Puts MuJoCo 3.17.0 (library and headers) into third_party/mujoco, from the PyPI wheel that carries it.
# Does nothing when it is there. Needs python3 with pip; no root.
set -euo pipefail
version=3.17.0
cd "$(dirname "$0")/.."
target=third_party/mujoco
if [ -e "$target/lib/libmujoco.so.$version" ]; then exit 0; fi
if ! python3 -m pip --version >/dev/null 2>&1; then
  echo "error: python3 with pip is not there" >&2
  echo "  where: scripts/fetch_mujoco.sh, which takes libmujoco.so from PyPI's wheel mujoco==$version" >&2
  echo "  try: apt-get install python3-pip, or put libmujoco.so.$version into $target/lib yourself" >&2
  exit 2
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
echo "fetching MuJoCo $version from PyPI"
# The wheel of any CPython holds the same library; name one so that the host's Python version does not matter.
if ! python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: --python-version 3.11 \
  --implementation cp --dest "$work" "mujoco==$version"; then
  echo "error: pip could not download mujoco==$version" >&2
  echo "  where: scripts/fetch_mujoco.sh; pip's own words are above" >&2
  echo "  try: check the network and pip's settings, or put libmujoco.so.$version into $target/lib yourself" >&2
  exit 2
fi
python3 - "$work" <<'PY'
import glob, sys, zipfile
zipfile.ZipFile(glob.glob(sys.argv[1] + "/mujoco-*.whl")[0]).extractall(sys.argv[1])
PY
mkdir -p "$target/lib.new"
cp "$work/mujoco/libmujoco.so.$version" "$target/lib.new/"
ln -sf "libmujoco.so.$version" "$target/lib.new/libmujoco.so"
rm -rf "$target/include" "$target/lib"
cp -r "$work/mujoco/include" "$target/include"
mv "$target/lib.new" "$target/lib"
