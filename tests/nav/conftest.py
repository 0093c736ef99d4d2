"""Compiled filters are large, and nothing frees them: thousands in one process end in a crash of the compiler."""

import gc

import jax
import pytest


@pytest.fixture(scope="module", autouse=True)
def _compiled_code_goes_with_its_file():
    yield
    jax.clear_caches()
    gc.collect()
