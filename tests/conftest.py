"""Strict settings for the whole run, made before either package is imported."""

import gc
import os
from pathlib import Path

# Most of the time of the suite goes into compiling programs that run once; the older of XLA's two code generators for
# CPUs takes half as long as the one it has by default (with which `XLA_FLAGS= pytest` runs everything).
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false")

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_num_cpu_devices", 2)

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture
def key():
    return jax.random.key(20261121)


@pytest.fixture(scope="module")
def quick_compilation():
    """For files of large programs that run once on little data: half the time to compile, several times that to run."""
    jax.config.update("jax_disable_most_optimizations", True)
    yield
    jax.config.update("jax_disable_most_optimizations", False)
    jax.clear_caches()
    gc.collect()


@pytest.fixture
def rendered_figures(monkeypatch):
    """Draw each figure that the test has made, which is when layout and fonts complain (warnings are errors)."""
    from gmwm_jax._internal import figures

    made, canvas = [], figures.FigureCanvasAgg
    monkeypatch.setattr(figures, "FigureCanvasAgg", lambda figure: made.append(figure) or canvas(figure))
    yield made
    for figure in made:
        figure.canvas.draw()


@pytest.fixture(scope="session")
def shared():
    """Reference numbers and real recordings; where they are missing the tests that need them skip."""
    if not SHARED.is_dir():
        if os.environ.get("CI"):
            pytest.fail(f"CI must have {SHARED}")
        pytest.skip(f"no reference data at {SHARED}")
    return SHARED
