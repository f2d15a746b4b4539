# Works on a fresh machine that has Python >= 3.11, pip and make.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RUN    := $(VENV)/.run-installed
DEV    := $(VENV)/.dev-installed

# Three processes for two cores (tests/conftest.py), as tests wait for other programs and for clocks;
# each has one thread. A file's tests go to one process, so that what they share is made once. Byte code is kept: the suite starts the command line many times.
PYTEST := PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadscope

.PHONY: help install demo test browser check studies bench accuracy docs clean
help:  ## show this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade "pip>=25.1"

$(RUN): pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[table]'
	@touch $@

$(DEV): pyproject.toml constraints.txt | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[all]' --group dev
	@touch $(RUN) $@

install: $(DEV)  ## everything, in .venv: all extras, and the tools for tests and checks

demo: $(RUN)  ## a sensor and then five axes at once: parameters found, pages to look at
	$(BIN)/hmpim demo
	$(BIN)/hmpim campaign demo --out out/demo-table

test: $(DEV)  ## the test suite: a few minutes on two cores
	$(PYTEST)

# One process: there is one workbench and one browser, which are busy themselves.
browser: $(DEV)  ## the workbench in a browser (Chromium), what `make test` leaves out
	$(PYTEST) -n 0 -m browser tests/workbench

studies: $(DEV)  ## the long form: HMPIM_SEEDS seeds (200), HMPIM_EXAMPLES times the examples (50)
	HMPIM_EXAMPLES=$${HMPIM_EXAMPLES:-50} $(PYTEST) -m "study or hypothesis"

check: $(DEV)  ## ruff, mypy strict, import-linter
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(DEV)  ## speed, against a hand-written fit in the same run
	$(BIN)/python benchmarks/identification_speed.py
	$(BIN)/python benchmarks/peers.py --growth 1e6
	$(BIN)/python benchmarks/fleet.py --records 1000
	$(BIN)/python benchmarks/response_accuracy.py
	$(BIN)/python benchmarks/live.py
	$(BIN)/python benchmarks/workbench.py
	$(BIN)/python benchmarks/pages_time.py

accuracy: $(DEV)  ## every figure of docs/accuracy.md, from scratch
	$(BIN)/python benchmarks/accuracy.py

docs: $(DEV)  ## the documents as a site, and the paper made again, into docs/build
	$(BIN)/sphinx-build -W --keep-going -q -b html -d docs/build/.doctrees docs docs/build
	$(BIN)/hmpim paper --out docs/build/paper
	@echo "Site: docs/build/index.html, paper: docs/build/paper/index.html"

clean:  ## remove .venv and what the commands made
	rm -rf $(VENV) docs/build out
