# Two commands do everything on a machine with python3 and make: `make demo` and `make test`.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready

# Bytecode is kept whatever the environment says, or every process would compile all that it imports.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo test test-all test-lowest test-newest tests all-tests ready free-kernels loaded-kernels flat-kernels collected browser quick fast record check lint types format bench atlas paper docs lock clean

help:
	@echo "make demo    set up, then compute the paper's design into out/"
	@echo "make test    set up, then run every check and test"
	@echo "make quick   format, lint, layers, types and the fast tests: for every edit"
	@echo "make test-all  as make test, with the large sizes"
	@echo "make test-lowest  the fast tests with the lowest versions that pyproject.toml allows"
	@echo "make test-newest  the fast tests with the newest versions there are; NEWEST_PYTHON names a Python"
	@echo "make record  every test; which are slow goes into tests/durations.json"
	@echo "make check   format, lint, types, layers, documentation"
	@echo "make bench   the benchmarks; writes docs/benchmarks.md"
	@echo "make atlas   the paper's 16 x 16 designs of 400,000 points into out/; can be interrupted"
	@echo "make paper   every figure and statement of the paper, recomputed into out/paper; can be interrupted"
	@echo "make docs    build the documentation into site/"
	@echo "make setup   make .venv from requirements.lock"
	@echo "make lock    renew requirements.lock"

setup: $(READY)

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	@command -v uv >/dev/null || $(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	PATH="$(CURDIR)/$(BIN):$$PATH" uv pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock
	PATH="$(CURDIR)/$(BIN):$$PATH" uv pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
	@touch $(READY)

demo: setup
	$(BIN)/softreach demo --out out --overwrite

# Tests side by side, up to four on as many cores.
TESTS := $(BIN)/python -m pytest -q --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder --max-worker-restart 0

# The checks run beside the compilers of the kernels, which have a core each, and so does what every
# process of the tests would else do anew: turn their assertions into ones that tell values.
test: ready
	$(MAKE) --no-print-directory tests

test-all: ready
	$(MAKE) --no-print-directory all-tests

tests:
	$(TESTS)

all-tests:
	$(TESTS) -m "large or not large"

ready: setup
	$(MAKE) --no-print-directory -j2 --output-sync=target free-kernels loaded-kernels flat-kernels check browser collected

# Compiled once here, and not by every process of the tests.
free-kernels: setup
	$(BIN)/softreach warmup --only free

loaded-kernels: setup
	$(BIN)/softreach warmup --only loaded

flat-kernels: setup
	$(BIN)/softreach warmup --only flat

collected: setup
	@$(BIN)/python -m pytest -q -q --collect-only >/dev/null || true  # the tests say why

# The studio is tested in a real browser. Only root installs one; whoever has none is told at the end
# of the tests what to type.
browser:
	@command -v chromium >/dev/null || [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null \
		|| { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq chromium >/dev/null; } \
		|| true

# For every edit: types and fast tests side by side, a process each.
quick: lint
	$(MAKE) --no-print-directory -j2 --output-sync=target types fast

fast: setup
	$(BIN)/python -m pytest -q --quick tests

# The fast tests with the lowest version of each dependency that has a wheel, in an environment and
# with compiled kernels of its own.
LOWEST := .venv-lowest

test-lowest: $(LOWEST)/.ready
	NUMBA_CACHE_DIR=$(CURDIR)/.cache/lowest $(MAKE) --no-print-directory fast BIN=$(LOWEST)/bin

$(LOWEST)/.ready: $(READY)
	$(PYTHON) -m venv --clear $(LOWEST)
	PATH="$(CURDIR)/$(BIN):$$PATH" uv pip install --quiet --python $(LOWEST)/bin/python --resolution lowest-direct --only-binary :all: -r pyproject.toml --all-extras --group dev
	PATH="$(CURDIR)/$(LOWEST)/bin:$(CURDIR)/$(BIN):$$PATH" uv pip install --quiet --python $(LOWEST)/bin/python --no-deps --no-build-isolation --editable .
	@touch $@

# The same with the newest version of each dependency.
NEWEST := .venv-newest
NEWEST_PYTHON ?= $(PYTHON)

test-newest: $(NEWEST)/.ready
	NUMBA_CACHE_DIR=$(CURDIR)/.cache/newest $(MAKE) --no-print-directory fast BIN=$(NEWEST)/bin

$(NEWEST)/.ready: $(READY)
	$(NEWEST_PYTHON) -m venv --clear $(NEWEST)
	PATH="$(CURDIR)/$(BIN):$$PATH" uv pip install --quiet --python $(NEWEST)/bin/python --upgrade --only-binary :all: -r pyproject.toml --all-extras --group dev
	PATH="$(CURDIR)/$(NEWEST)/bin:$(CURDIR)/$(BIN):$$PATH" uv pip install --quiet --python $(NEWEST)/bin/python --no-deps --no-build-isolation --editable .
	@touch $@

# Renews the list of slow tests, which `make quick` leaves out; on an idle machine.
record: setup browser
	$(TESTS) --record
	$(BIN)/python -m pytest -q --record --quick tests

check: lint types
	$(BIN)/python -m zensical build --strict --clean

lint: setup
	$(BIN)/ruff format --check src tests benchmarks tools
	$(BIN)/ruff check src tests benchmarks tools
	$(BIN)/lint-imports

types: setup
	$(BIN)/python -m tools.pages
	$(BIN)/basedpyright

format: setup
	$(BIN)/ruff format src tests benchmarks tools
	$(BIN)/ruff check --fix src tests benchmarks tools

bench: setup
	$(BIN)/python -m benchmarks

atlas: setup
	$(BIN)/softreach atlas build out/atlas.zarr --vary revolution_deg=0:108:16 --vary taper_deg=0:3:16
	$(BIN)/softreach atlas figures out/atlas.zarr --out out/atlas --overwrite

paper: setup
	$(BIN)/softreach paper --out out/paper --overwrite

docs: setup
	$(BIN)/python -m zensical build --strict --clean

lock:
	uv lock --upgrade
	uv export --quiet --all-extras --all-groups --no-emit-project --no-header --format requirements-txt --output-file requirements.lock

clean:
	rm -rf .venv $(LOWEST) $(NEWEST) out site build .cache
