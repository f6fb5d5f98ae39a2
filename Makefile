.PHONY: setup demo test test-slow check check-types check-style check-names benchmark gallery docs system browser clean
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT := out
# Without stored bytecode, every process that a test starts would compile the package again.
unexport PYTHONDONTWRITEBYTECODE

help:
	@echo "make demo       set up, record a rig with a defect, diagnose it, plot and film a drop test"
	@echo "make test       set up, run all tests but the slow ones"
	@echo "make test-slow  the slow ones: longer recordings, more of a sort"
	@echo "make setup      make $(VENV) with everything in it"
	@echo "make check      ruff, pyright, the contract of imports, spelling, docstrings, names"
	@echo "make benchmark  speeds, side by side"
	@echo "make docs       the pages of docs and a reference of the API: $(OUT)/docs/index.html"
	@echo "make gallery    the thesis reproduced: docs/gallery.md, its pictures and videos"

setup: $(VENV)/.done

# uv takes a fifth of pip's time; pip does it where uv cannot be had or does not reach the index.
$(VENV)/.done: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "rigtwin needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) -V). Name another: make setup PYTHON=python3.12"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	-$(BIN)/pip install --quiet --upgrade pip uv
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --editable '.[dev]' || $(BIN)/pip install --quiet --editable '.[dev]'
	@touch $@

system: setup
	@BIN=$(BIN) bash scripts/rendering_packages.sh

demo: setup system
	@mkdir -p $(OUT)
	$(BIN)/rigtwin run imposed --effect viscous@motor=50 --effect gain@suspension_lvdt=0.965 --out $(OUT)/rig.mcap
	$(BIN)/rigtwin diagnose $(OUT)/rig.mcap --html $(OUT)/report.html --save-twin $(OUT)/calibrated.toml
	$(BIN)/rigtwin run drop --config $(OUT)/calibrated.toml --out $(OUT)/drop.mcap
	$(BIN)/rigtwin plot $(OUT)/drop.mcap -o $(OUT)/drop.png
	$(BIN)/rigtwin video $(OUT)/drop.mcap -o $(OUT)/drop.mp4 --until 10
	@echo "look at $(OUT)/report.html, $(OUT)/drop.png and $(OUT)/drop.mp4"

# A file's tests share what they recorded and diagnosed: one worker takes them all.
test: setup system browser
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

test-slow: setup system
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder -m slow

browser:
	@bash scripts/browser.sh

check: setup
	@$(MAKE) --no-print-directory --jobs 2 --output-sync check-types check-style check-names

check-types: setup
	$(BIN)/pyright

check-style: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache
	$(BIN)/codespell README.md CONTRIBUTING.md CHANGELOG.md docs/*.md rigtwin controllers experiments referee machines
	$(BIN)/numpydoc lint rigtwin/api/*.py

check-names: setup
	$(BIN)/python -m pytest -n0 tests/test_language.py tests/test_glossary.py

benchmark: setup
	$(BIN)/python -m benchmarks

gallery: setup system
	@mkdir -p $(OUT) docs/gallery
	$(BIN)/rigtwin reproduce --folder $(OUT)/reproduction --gallery docs --html $(OUT)/thesis.html
	$(BIN)/rigtwin run drop --out $(OUT)/drop.mcap
	$(BIN)/rigtwin run road10 --out $(OUT)/road10.mcap
	$(BIN)/rigtwin run beam-semi-active --out $(OUT)/beams.mcap
	$(BIN)/rigtwin video $(OUT)/drop.mcap -o docs/gallery/drop.mp4 --until 6
	$(BIN)/rigtwin video $(OUT)/road10.mcap -o docs/gallery/road10.mp4 --until 8
	$(BIN)/rigtwin video $(OUT)/beams.mcap -o docs/gallery/beams.mp4 --until 6

docs: setup $(VENV)/.docs
	$(BIN)/sphinx-build -W --keep-going -q -b html -d $(OUT)/docs-cache docs $(OUT)/docs
	@echo "look at $(OUT)/docs/index.html"

$(VENV)/.docs: $(VENV)/.done
	$(BIN)/pip install --quiet --editable '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) $(OUT) build *.egg-info
