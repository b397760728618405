#!/usr/bin/env bash
# rust-hdf5 0.7.9: string attributes that h5py 3 reads, and that the HDF5 library's own H5Aread refuses.
#
# Seen: set_attr_string writes a variable-length string whose base type is a string of one character;
# the HDF5 library writes an unsigned byte. h5py 3 does not mind, so the file looks right. A C or
# C++ program reads into H5T_C_S1 of variable size (as every example does), the library looks for a
# conversion from characters to bytes, and there is none: -1. Only the base type decides: with the
# library's base in its place, the same attribute is read.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet h5py==3.16.0 numpy
mkdir -p "$work/writer/src"
cat > "$work/writer/Cargo.toml" <<'TOML'
[package]
name = "writer"
version = "0.0.0"
edition = "2024"
[dependencies]
rust-hdf5 = "=0.7.9"
TOML
cat > "$work/writer/src/main.rs" <<'RS'
fn main() {
    let file = rust_hdf5::H5File::create(std::env::args().nth(1).unwrap()).unwrap();
    file.create_group("data").unwrap().set_attr_string("text", "hello").unwrap();
    file.close().unwrap();
}
RS
(cd "$work/writer" && CARGO_TARGET_DIR="$work/target" cargo run --quiet -- "$work/rust.h5")
"$work/venv/bin/python" - "$work" <<'PY'
import ctypes, glob, os, sys
import h5py

work = sys.argv[1]
with h5py.File(f"{work}/own.h5", "w") as f:
    f.create_group("data").attrs["text"] = "hello"

# The library that h5py itself uses.
libs = os.path.join(os.path.dirname(os.path.dirname(h5py.__file__)), "h5py.libs", "libhdf5*.so*")
lib = ctypes.CDLL(next(p for p in glob.glob(libs) if "_hl" not in p))
for name in ["H5Fopen", "H5Oopen", "H5Aopen", "H5Tcopy"]:
    getattr(lib, name).restype = ctypes.c_int64
lib.H5open()
number = ctypes.c_int64

def h5aread(path):
    file = lib.H5Fopen(path.encode(), 0, number(0))
    attribute = lib.H5Aopen(number(lib.H5Oopen(number(file), b"data", number(0))), b"text", number(0))
    kind = lib.H5Tcopy(number(number.in_dll(lib, "H5T_C_S1_g").value))
    lib.H5Tset_size(number(kind), ctypes.c_size_t(-1)), lib.H5Tset_cset(number(kind), 1)
    text = ctypes.c_char_p()
    said = lib.H5Aread(number(attribute), number(kind), ctypes.byref(text))
    return text.value if said >= 0 else said

found = {}
for name in ["own", "rust"]:
    with h5py.File(f"{work}/{name}.h5") as f:
        found[name] = f["data"].attrs["text"], h5aread(f"{work}/{name}.h5")
print(f"h5py {h5py.__version__}, HDF5 {h5py.version.hdf5_version}; by h5py and by H5Aread: {found}")
assert found["own"] == ("hello", b"hello"), "h5py's own file"
assert found["rust"] == ("hello", -1), "no longer so"
PY
