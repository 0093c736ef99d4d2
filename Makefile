# Two commands do everything on a fresh machine: `make demo` and `make test`. While working: `make test ROOM=fitting`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo app test test-web validate test-old-cpu check docs clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

demo: $(VENV)/.installed  ## simulated MTi-G recording -> noise models -> filters that believe them; all under out/
	$(BIN)/python -m gmwm_jax demo --out out
	$(BIN)/python -m nav_jax demo --fits out --out out

app: $(VENV)/.installed  ## the page in the browser, on this machine alone
	$(BIN)/python -m gmwm_jax app

# all rooms, or one; what takes a second or more, or its data five, is run by `make validate`, or here where SLOW is 1
QUICK := $(if $(SLOW),,-m "not slow")
TESTS := $(if $(ROOM),$(wildcard tests/*/$(ROOM)))
PYTEST = $(BIN)/python -m pytest --numprocesses auto --dist loadfile --no-loadscope-reorder $(if $(TYPED),$(CHECKED))

# Annotations are checked at every call within the packages where TYPED is 1. That is a fifth of the time of `make test`,
# and most of that of what is repeated a thousand times, so that it is left to the rooms of numbers on another processor
# and to the examples, of which every public function has one.
CHECKED := --jaxtyping-packages=gmwm_jax,nav_jax,beartype.beartype
test-old-cpu: TYPED := 1

test: $(VENV)/.installed  ## everything but what `make validate` runs; ROOM=name for the rooms of that name only, SLOW=1, TYPED=1
	$(if $(ROOM),$(if $(TESTS),,$(error There is no room $(ROOM); see tests/gmwm and tests/nav)))
	$(PYTEST) $(QUICK) $(TESTS)

# In one process: the server, the browser and the tests share two cores, and compiled functions.
test-web: $(VENV)/.installed  ## the page, in a real browser (chromium)
	$(BIN)/python -m pytest tests/web

# where the statistics are written down, each with its band, number of draws and commit; the table that is kept is whole
RECORD ?= $(if $(ALL),benchmarks/results,out)/validation.json

NOTEBOOKS := tests/validation/test_notebooks.py

# What tests/validation/long.py names takes half an hour more: it is run where ALL is 1, before a release.
validate: $(VENV)/.installed  ## slow tests of the rooms, statistics against their bands, README and notebooks; ALL=1
	$(PYTEST) -m slow tests/gmwm tests/nav
	$(PYTEST) $(CHECKED) $(filter-out $(NOTEBOOKS),$(wildcard tests/validation/test_*.py))
	$(PYTEST) $(NOTEBOOKS) tests/validation/gmwm tests/validation/nav --record $(RECORD) $(if $(ALL),,--short)

# A tolerance that holds on one processor only is none of the method's: rooms of numbers, without the instructions of
# the last fifteen years, in XLA and in NumPy.
NUMERICAL := tests/validation/nav/test_another_earth.py tests/validation/gmwm/test_process_derivatives.py \
  tests/nav/kinematics tests/nav/trajectory tests/nav/imu tests/nav/filter tests/gmwm/processes tests/gmwm/variance
DISPATCHED = from numpy._core._multiarray_umath import __cpu_dispatch__ as d, __cpu_features__ as f; print(*(x for x in d if f[x]))

test-old-cpu: $(VENV)/.installed  ## the numerical rooms as on a processor of 2008 (x86-64)
	XLA_FLAGS="--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1 --xla_cpu_max_isa=SSE4_2" \
	NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c '$(DISPATCHED)')" $(PYTEST) $(QUICK) $(NUMERICAL)

check: $(VENV)/.installed  ## lint, format, types; names files that have grown long; every test is where `make validate` looks
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/python .ci/long_files.py gmwm_jax nav_jax tests benchmarks
	$(BIN)/python -m pytest -qq --collect-only --short tests/validation

docs: $(VENV)/.installed  ## the API reference, from the docstrings, in out/docs
	$(BIN)/python notebooks/api_reference.py out/docs

clean:
	rm -rf $(VENV) out
