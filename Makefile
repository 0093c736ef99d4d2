# Two commands do everything on a fresh machine: `make demo` and `make test`. While working: `make test ROOM=fitting`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test validate check docs clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

demo: $(VENV)/.installed  ## simulated MTi-G recording -> noise models -> filters that believe them; all under out/
	$(BIN)/python -m gmwm_jax demo --out out
	$(BIN)/python -m nav_jax demo --fits out --out out

# all rooms, or one
TESTS := $(if $(ROOM),$(wildcard tests/*/$(ROOM)))
PYTEST := $(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed  ## everything but what `make validate` runs; ROOM=name for the rooms of that name only
	$(if $(ROOM),$(if $(TESTS),,$(error There is no room $(ROOM); see tests/gmwm and tests/nav)))
	$(PYTEST) $(TESTS)

validate: $(VENV)/.installed  ## statistics against their bands, README and notebooks
	$(PYTEST) tests/validation

check: $(VENV)/.installed  ## lint, format, types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

docs: $(VENV)/.installed  ## the API reference, from the docstrings, in out/docs
	$(BIN)/python notebooks/api_reference.py out/docs

clean:
	rm -rf $(VENV) out
