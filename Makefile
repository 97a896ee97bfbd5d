# Two commands: `make demo` and `make test`. Both set up what they need, and may be run again.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# Tests start hundreds of interpreters: without bytecode each would compile every source again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-slow test-long vm arm campaign docs lint lint-types lint-rest setup clean

setup: $(STAMP)

$(STAMP): pyproject.toml devices/pyproject.toml benchmarks/pyproject.toml
	@echo "setting up $(VENV): takes a minute or two the first time"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]' --editable ./devices --editable './benchmarks[machines]'
	@touch $@

demo: $(STAMP)
	$(BIN)/motorctl demo

test: $(STAMP)
	$(BIN)/python -m pytest -n auto --dist loadfile -m 'not slow and not wall_clock'
	$(BIN)/python -m pytest -n 3 --dist worksteal -m 'not slow and wall_clock(lanes=3)'
	$(BIN)/python -m pytest -m 'not slow and wall_clock and not wall_clock(lanes=3)' || test $$? -eq 5  # 5: there is none

test-slow: $(STAMP)
	$(BIN)/python -m pytest --durations 20 -n auto --dist worksteal -m 'slow and not wall_clock and not long'
	$(BIN)/python -m pytest --durations 20 -n 3 --dist worksteal -m 'slow and wall_clock(lanes=3) and not long'
	$(BIN)/python -m pytest -m 'slow and wall_clock and not wall_clock(lanes=3) and not long'

# What `test-slow` promises, over every machine, kind and number that there is: before a release.
test-long: $(STAMP)
	$(BIN)/python -m pytest -n auto --dist worksteal -m 'long and not wall_clock'
	$(BIN)/python -m pytest -m 'long and wall_clock' --ignore tests/system/test_service_machine.py

# The service in a virtual machine: half an hour once it is built, with nothing beside.
vm: $(STAMP)
	PYTHONPATH=tests/support $(BIN)/python -m service_machine --out out/service_machine

# The compiled loop on an emulated 64-bit ARM processor: minutes, more the first time.
arm: $(STAMP)
	PYTHONPATH=tests/support $(BIN)/python -m arm_processor

# Faults x states x machines x controllers; `make campaign SIZE=full` is the one in docs/campaign.md.
SIZE ?= small
campaign: $(STAMP)
	@$(BIN)/motorctl bench campaign --size $(SIZE)

# The documentation as a site that needs neither network nor server: out/site/index.html.
docs: $(STAMP)
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet --fresh-env --write-all -d out/site-cache docs out/site
	@echo "out/site/index.html"

# The types take as long as all the rest: beside it.
lint: $(STAMP)
	@$(MAKE) --no-print-directory --jobs 2 --output-sync=target lint-types lint-rest

lint-types: $(STAMP)
	$(BIN)/mypy

lint-rest: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/python tools/effects_quoted.py
	$(BIN)/python tools/constants_told.py
	$(BIN)/python tools/docstrings_return.py
	$(BIN)/python tools/draw_states.py --check
	$(BIN)/python tools/reference.py --check

clean:
	rm -rf $(VENV)
