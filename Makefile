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

.PHONY: help setup build demo test fmt clippy bench clean

help:
	@echo 'make demo    record a sample object (OBJECT=$(OBJECT)), build its twin, write the report'
	@echo 'make test    format check, lints, all tests; real objects when HINGECAST_DATA points at them'
	@echo 'make build   $(TARGET)/release/hingecast'
	@echo 'make bench   quality and time of a suite (SUITE=$(SUITE)); BENCH_FLAGS="--against baseline.json" compares'
	@echo 'make clean   forget what was built; recordings and runs stay'

# Says what is missing and how to get it; fetches MuJoCo once.
setup:
	@CARGO='$(CARGO)' scripts/check_tools.sh
	@scripts/fetch_mujoco.sh

build: setup
	$(CARGO) build --release --locked

demo: build
	$(TARGET)/release/hingecast demo $(OBJECT)

fmt:
	$(CARGO) fmt --all --check

clippy: setup
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

# Cheapest check first. The log serves to name, at the end, the tests that had nothing to test.
test: setup
	@$(MAKE) --no-print-directory fmt
	@$(MAKE) --no-print-directory clippy
	@mkdir -p $(TARGET)
	$(CARGO) test --workspace --locked -- --show-output 2>&1 | tee $(TARGET)/test.log
	@scripts/skipped_tests.sh $(TARGET)/test.log

bench: build
	$(TARGET)/release/hingecast bench $(SUITE) $(BENCH_FLAGS)

clean:
	$(CARGO) clean
