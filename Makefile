# `make` formats, builds, lints and tests. Every target sets up what it needs: a virtual environment in .venv, with
# the extension built in release mode.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
BUILT := $(VENV)/.built
CARGO_TARGET_DIR ?= target
export CARGO_TARGET_DIR
export PIP_QUIET := 1

# `make` installs the versions of the lock; LATEST=1 the newest, as users get them (then begin with `make clean`).
LOCK := packaging/development.lock
ifndef LATEST
export PIP_CONSTRAINT := $(abspath $(LOCK))
endif

.PHONY: all format build lint test test-rust test-python fuzz audit lock demo bench docs wheel clean

all: format build lint test

# Dependencies, and the tools of development.
$(READY): pyproject.toml $(LOCK)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --group dev
	touch $@

# The package, editable: only a change of the Rust side or of the dependencies builds it again.
$(BUILT): $(READY) Cargo.toml Cargo.lock $(wildcard rust/src/*.rs rust/src/*/*.rs)
	$(BIN)/maturin develop --release --quiet
	touch $@

build: $(BUILT)

format: $(READY)
	cargo fmt
	$(BIN)/ruff format --quiet
	$(BIN)/ruff check --quiet --fix --select I

lint: $(BUILT)
	cargo fmt --check
	cargo clippy --quiet --all-targets --all-features -- -D warnings
	$(BIN)/ruff format --check --quiet
	$(BIN)/ruff check --quiet
	$(BIN)/mypy
	$(BIN)/stubtest sketchcore._core --mypy-config-file pyproject.toml --ignore-disjoint-bases

test: test-rust test-python

test-rust:
	cargo test --quiet

# The tests of the app draw in a real browser, and are skipped where there is none: this installs it where it may. Each of
# WORKERS processes takes whole files of tests, fast ones first; plain `pytest` runs all in one.
WORKERS ?= 2
test-python: $(BUILT)
	@command -v chromium >/dev/null || [ "$$(id -u)" != 0 ] || { apt-get update -qq; \
		DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends chromium; } >/dev/null || true
	$(BIN)/pytest --quiet --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder

# A minute of each target, or FUZZ_SECONDS; what is found is kept in fuzz/findings. TARGETS="mesh http" takes some.
FUZZ_SECONDS ?= 60
fuzz: $(BUILT)
	$(BIN)/pip install --quiet --group fuzz
	$(BIN)/python fuzz/run.py --seconds $(FUZZ_SECONDS) $(TARGETS)

# What is known against the libraries that are used: asks databases in the network, which nothing else here does.
audit: $(READY)
	$(BIN)/pip install --quiet --group audit
	$(BIN)/pip-audit --local --skip-editable
	cargo audit

# The newest versions, in an environment of its own, become those of the lock.
lock:
	rm -rf out/lock && $(PYTHON) -m venv out/lock
	PIP_CONSTRAINT= out/lock/bin/pip install --quiet --upgrade pip
	PIP_CONSTRAINT= out/lock/bin/pip install --quiet --group dev
	PIP_CONSTRAINT= out/lock/bin/pip install --quiet .
	grep '^#' $(LOCK) > out/lock/kept
	out/lock/bin/pip freeze --exclude sketchcore | grep -viE '^(torch|triton|nvidia|cuda)' >> out/lock/kept
	mv out/lock/kept $(LOCK)
	rm -rf out/lock

demo: $(BUILT)
	$(BIN)/python examples/demo.py

# Kernels and calls beside what one would otherwise use; the peers (about 1.5 GB) are installed first.
bench: $(BUILT)
	$(BIN)/maturin develop --release --quiet --extras bench
	$(BIN)/sketchcore bench
	cargo bench --quiet
	$(BIN)/pytest --quiet benches

# The guide and the API reference, as out/docs/docs/index.html; a warning is an error.
docs: $(BUILT)
	$(BIN)/sphinx-build --quiet --fail-on-warning --keep-going -c docs . out/docs

# The wheel and the source distribution in out/dist; the wheel is installed in an empty environment, away from the
# sources, and runs the demo there.
wheel: $(READY)
	$(BIN)/maturin build --release --sdist --quiet --out out/dist
	PIP_CONSTRAINT= packaging/try-wheel out/dist/*.whl

clean:
	rm -rf $(VENV) target out
