# hingecast: every target sets up what it needs first. `make` alone lists them.
#
# Needed beforehand: Rust's stable toolchain (1.95 or newer), a C and C++ compiler, make, python3 with pip.

SHELL := /bin/bash
.SHELLFLAGS := -eo pipefail -c
.DEFAULT_GOAL := help

CARGO ?= cargo
# Where cargo puts what it builds.
TARGET := $(or $(CARGO_TARGET_DIR),target)
# The demo's object: any folder of objects/.
OBJECT ?= hinged_box
# What `make bench` runs: ours, real, all or names; and flags for `hingecast bench`.
SUITE ?= ours
BENCH_FLAGS ?=
# What `make fuzz` runs, and for how long in all; every reader gets 5 seconds at least.
FUZZ_TARGETS ?=
FUZZ_SECONDS ?= 60
# Flags for scripts/torture: --quick, --seconds N, --only kills,disks,damage,swaps,once.
TORTURE_FLAGS ?=
DENY := third_party/cargo-deny/bin/cargo-deny

.PHONY: help setup build demo test fmt circles page deny clippy doc tests advisories fuzz torture bench web clean

help:
	@echo 'make demo    record a sample object (OBJECT=$(OBJECT)), build its twin, write the report'
	@echo 'make test    format, licences, lints, docs, all tests; real objects when HINGECAST_DATA points at them'
	@echo 'make build   $(TARGET)/release/hingecast'
	@echo 'make bench   quality and time of a suite (SUITE=$(SUITE)); BENCH_FLAGS="--against baseline.json" compares'
	@echo 'make fuzz    damaged files for every reader, FUZZ_SECONDS=$(FUZZ_SECONDS) in all; FUZZ_TARGETS="ply_mesh urdf" picks'
	@echo 'make torture kills, full disks, damaged files, swapped runs; TORTURE_FLAGS="--quick" is a tenth of it'
	@echo 'make web     the page of `hingecast view` out of web/ (needs npm); the result is checked in'
	@echo 'make clean   forget what was built; recordings and runs stay'
	@echo
	@echo 'one check alone: make fmt | circles | page | deny | clippy | doc | tests; make advisories asks the network for known holes'

# Says what is missing and how to get it; fetches MuJoCo once.
setup:
	@CARGO='$(CARGO)' scripts/check_tools.sh
	@scripts/fetch_mujoco.sh

build: setup
	$(CARGO) build --release --locked

demo: build
	$(TARGET)/release/hingecast demo $(OBJECT)

# Cheapest check first.
test: setup
	@$(MAKE) --no-print-directory fmt
	@$(MAKE) --no-print-directory circles
	@$(MAKE) --no-print-directory page
	@$(MAKE) --no-print-directory deny
	@$(MAKE) --no-print-directory clippy
	@$(MAKE) --no-print-directory doc
	@$(MAKE) --no-print-directory tests

fmt:
	$(CARGO) fmt --all --check
	$(CARGO) fmt --manifest-path fuzz/Cargo.toml --check

# No file imports in a circle.
circles:
	python3 scripts/import_circles.py

# The page of `hingecast view` is made of web/ as it is.
page:
	python3 scripts/page_is_current.py

# The page of `hingecast view`, from web/; needs node and npm. What it writes is checked in.
web:
	cd web && npm ci --no-audit --no-fund && npm run build

# What deny.toml allows, of the programs and of the fuzz targets. Duplicates are warnings there, and not shown.
deny:
	@CARGO='$(CARGO)' scripts/fetch_cargo_deny.sh
	$(DENY) --log-level error --locked check licenses bans sources
	$(DENY) --log-level error --locked --manifest-path fuzz/Cargo.toml --config deny.toml check licenses bans sources

# Known security holes: a list that changes daily, so no change of ours is held against it.
advisories:
	@CARGO='$(CARGO)' scripts/fetch_cargo_deny.sh
	$(DENY) --log-level error --locked check advisories

clippy: setup
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

doc: setup
	RUSTDOCFLAGS='-D warnings' $(CARGO) doc --workspace --no-deps --locked

# The log serves to name, at the end, the tests that had nothing to test.
tests: setup
	@mkdir -p $(TARGET)
	$(CARGO) test --workspace --locked -- --show-output 2>&1 | tee $(TARGET)/test.log
	@scripts/skipped_tests.sh $(TARGET)/test.log

fuzz:
	@CARGO='$(CARGO)' scripts/check_tools.sh
	@CARGO='$(CARGO)' scripts/fuzz.sh $(FUZZ_SECONDS) $(FUZZ_TARGETS)

torture: build
	python3 scripts/torture $(TARGET)/release/hingecast $(TORTURE_FLAGS)

bench: build
	$(TARGET)/release/hingecast bench $(SUITE) $(BENCH_FLAGS)

clean:
	$(CARGO) clean
