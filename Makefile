# Two commands, each complete in a fresh clone: `make paper` (the main job) and `make test`.
# They need Python 3.11 or 3.12 and make; everything else goes into .venv.
PYTHON ?= python3
JOBS ?= 2
# The matrices are small, and threads that share them only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
# Many short processes import the same modules; each would compile them again.
unexport PYTHONDONTWRITEBYTECODE
BIN := .venv/bin
MARK := .venv/.installed

.PHONY: paper test lint benchmark clean

paper: $(MARK)
	$(BIN)/mocobot paper --jobs $(JOBS) --out out/paper --force
	$(BIN)/mocobot report out/paper --force

test: $(MARK) lint
	$(BIN)/pytest -n $(JOBS) --dist loadfile

lint: $(MARK)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

benchmark: $(MARK)
	$(BIN)/python benchmarks/speed/trial.py
	$(BIN)/python benchmarks/speed/paper.py

$(MARK): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13) and "mocobot needs Python 3.11 or 3.12: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $(MARK)

clean:
	rm -rf .venv out build dist
