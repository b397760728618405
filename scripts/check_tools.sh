#!/usr/bin/env bash
# Says which of the tools that hingecast is built with are missing, and how to get them. Installs nothing.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo=${CARGO:-cargo}
# The oldest Rust that the code allows is written in Cargo.toml, once.
need=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
failed=0

# missing WHAT WHERE TRY
missing() {
  printf 'error: %s\n  where: %s\n  try: %s\n' "$1" "$2" "$3" >&2
  failed=1
}

# older A B: whether version A comes before version B.
older() {
  [ "$1" != "$2" ] && [ "$(printf '%s\n%s\n' "$1" "$2" | sort -V | head -n 1)" = "$1" ]
}

if [ "$(uname -s)" != Linux ]; then
  missing "this build knows only Linux" "$(uname -sm)" "a Linux machine, a container or WSL 2"
fi

rust_hint="install Rust's stable toolchain with rustup, or 'rustup update stable'; Debian's own cargo is too old"
if ! version=$($cargo --version 2>/dev/null); then
  missing "cargo is not there" "PATH" "$rust_hint"
else
  version=$(echo "$version" | cut -d' ' -f2 | cut -d- -f1)
  if older "$version" "$need"; then
    missing "cargo is too old: $version, $need or newer is needed" "$(command -v "$cargo")" "$rust_hint"
  fi
fi

# Rust links with cc; mesh simplification (meshopt) is C++.
if ! command -v "${CC:-cc}" >/dev/null; then
  missing "a C compiler is not there" "${CC:-cc}" "apt-get install gcc libc6-dev (Debian, Ubuntu)"
fi
if ! command -v "${CXX:-c++}" >/dev/null; then
  missing "a C++ compiler is not there; mesh simplification (meshopt) needs one" "${CXX:-c++}" \
    "apt-get install g++ (Debian, Ubuntu)"
fi

# pip only downloads here, so Debian's 'externally managed environment' does not matter, and nothing is installed.
if ! ls third_party/mujoco/lib/libmujoco.so.* >/dev/null 2>&1; then
  if ! command -v python3 >/dev/null; then
    missing "python3 is not there; its pip fetches MuJoCo" "PATH" "apt-get install python3 python3-pip (Debian, Ubuntu)"
  elif ! python3 -m pip --version >/dev/null 2>&1; then
    missing "python3 has no pip; it fetches MuJoCo" "$(command -v python3)" "apt-get install python3-pip (Debian, Ubuntu)"
  fi
fi
exit $((2 * failed))
