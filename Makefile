# Two commands, each complete in a fresh clone: `make paper` (the main job) and `make test`.
# They need Python 3.11 to 3.14 and make; everything else goes into .venv.
PYTHON ?= python3
JOBS ?= 2
# The matrices are small, and threads that share them only wait for each other.
export OPENBLAS_NUM_THREADS ?= 1
# Many short processes import the same modules; each would compile them again.
unexport PYTHONDONTWRITEBYTECODE
BIN := .venv/bin
MARK := .venv/.installed
TYPED := out/.typed

.PHONY: paper test lint style benchmark docs clean

paper: $(MARK)
	$(BIN)/mocobot paper --jobs $(JOBS) --out out/paper --force
	$(BIN)/mocobot report out/paper --force

# Types are checked beside the tests, unless no source has changed since they were right: pyright takes 100 s of one core.
# The last line says which tests were skipped, and why.
test: $(MARK) style
	@rm -f .venv/skipped.txt; { test -f $(TYPED) && test -z "$$(find src pyproject.toml constraints.txt -newer $(TYPED) \
	-not -path '*/__pycache__*')" || { $(BIN)/pyright && mkdir -p out && touch $(TYPED); }; } > .venv/pyright.txt & \
	types=$$!; trap 'kill $$types' INT TERM; \
	SKIPPED_TO=.venv/skipped.txt $(BIN)/pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder; tests=$$?; \
	wait $$types; types=$$?; cat .venv/pyright.txt; \
	cat .venv/skipped.txt || tests=1; exit $$((tests | types))

lint: $(MARK) style
	$(BIN)/pyright

style: $(MARK)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

benchmark: $(MARK)
	$(BIN)/python benchmarks/speed/trial.py
	$(BIN)/python benchmarks/speed/paper.py

# Pages in out/site, opened from the disk; a warning ends it.
docs: .venv/.docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

.venv/.docs: $(MARK)
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable '.[docs]'
	touch .venv/.docs

# Compiled when imported: pip would compile 11,000 modules, and most are never used. dm-control comes without what it
# asks for: labmaze has no wheels for Python 3.13 and later, and nothing here uses it.
$(MARK): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15) and "mocobot needs Python 3.11 to 3.14: make PYTHON=python3.12 ...")'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable '.[dev]'
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --no-deps dm-control
	touch $(MARK)

clean:
	rm -rf .venv out build dist
