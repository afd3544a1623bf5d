# Two commands do everything on a machine with Python 3.11 or later and git: `make demo` and `make test`.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# what is never imported need not become bytecode: half of the time of an installation
INSTALL := bin/pip install --quiet --disable-pip-version-check --no-compile
# one thread for linear algebra: the work is many small buildings, and processes are how they share the cores
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
# bytecode is kept, whatever the shell says: tests start a hundred processes, and each would compile every source anew
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-oldest test-train lint docs bench clean

$(VENV)/core: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing hiproof and the packages that it needs into $(VENV); this takes a minute"
	$(VENV)/$(INSTALL) -e .
	touch $@

$(VENV)/test: $(VENV)/core
	$(VENV)/$(INSTALL) -e '.[test,city]'
	touch $@

$(VENV)/train: $(VENV)/test
	$(VENV)/$(INSTALL) torch==2.13.0 onnx matplotlib
	touch $@

$(VENV)/lint: $(VENV)/core
	$(VENV)/$(INSTALL) -e '.[lint]'
	touch $@

$(VENV)/docs: $(VENV)/core
	$(VENV)/$(INSTALL) -e '.[docs]'
	touch $@

demo: $(VENV)/core
	$(BIN)/hiproof demo --out demo
	$(BIN)/hiproof check demo/buildings.city.jsonl
	@echo "The models lie in demo/: buildings.gml (CityGML), buildings.city.jsonl (CityJSON), parameters.jsonl, buildings.gpkg"
	@echo "Look at them: $(BIN)/hiproof view demo"

test: $(VENV)/test
	$(BIN)/python -m pytest -m "not train" -n 2 --dist loadfile

# the oldest numba that pyproject.toml allows, and the newest NumPy that it takes
$(VENV)-oldest/core: pyproject.toml
	$(PYTHON) -m venv $(VENV)-oldest
	$(VENV)-oldest/$(INSTALL) 'numba==0.62.*' pytest hypothesis pytest-timeout -e .
	touch $@

# without the test that would compile all that runs call for this numba, too: minutes
test-oldest: $(VENV)-oldest/core
	$(VENV)-oldest/bin/python -m pytest tests/test_compiled.py -k "not halves"

test-train: $(VENV)/train
	$(BIN)/python -m pytest -m train tests/learn

lint: $(VENV)/lint
	$(BIN)/ruff check .
	$(BIN)/ruff check --preview --select PLW1514 .  # a text file without a named encoding is another one on Windows
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: $(VENV)/docs
	$(BIN)/mkdocs build --strict --quiet
	@echo "The site lies in build/site/index.html"

bench: $(VENV)/test
	$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) $(VENV)-oldest demo .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
