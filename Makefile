.PHONY: setup demo test check benchmark system clean
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT := out

help:
	@echo "make demo       set up, run a drop test on the twin, compare a rig recording with the twin, plot and film both"
	@echo "make test       set up, run all tests"
	@echo "make setup      make $(VENV) with everything in it"
	@echo "make check      ruff and pyright"
	@echo "make benchmark  speeds, side by side"

setup: $(VENV)/.done

$(VENV)/.done: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "rigtwin needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) -V). Name another: make setup PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade pip
	$(BIN)/pip install --quiet --editable '.[dev]'
	@touch $@

system: setup
	@BIN=$(BIN) bash scripts/rendering_packages.sh

demo: setup system
	@mkdir -p $(OUT)
	$(BIN)/rigtwin run drop --out $(OUT)/drop.mcap
	$(BIN)/rigtwin compare examples/nominal-imposed.mcap --json $(OUT)/compare.json
	$(BIN)/rigtwin plot $(OUT)/drop.mcap -o $(OUT)/drop.png
	$(BIN)/rigtwin video $(OUT)/drop.mcap -o $(OUT)/drop.mp4 --until 10
	@echo "look at $(OUT)/drop.png and $(OUT)/drop.mp4"

test: setup system
	$(BIN)/python -m pytest -n auto

check: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

benchmark: setup
	$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) $(OUT) build *.egg-info
