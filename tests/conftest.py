"""Strict settings for the whole run, made before either package is imported."""

import gc
import hashlib
import os
import platform
import sys
from pathlib import Path

# Most of the time of the suite goes into compiling programs that run once; the older of XLA's two code generators for
# CPUs takes half as long as the one it has by default (with which `XLA_FLAGS= pytest` runs everything), and a quarter
# goes into cutting programs in parts for threads, which workers have no use for.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1")

# Of small matrices, and beside other workers, threads of BLAS wait for each other most of the time. Workers inherit it;
# in one process NumPy may have been imported already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_num_cpu_devices", 2)

ROOT = Path(__file__).resolve().parents[1]


def kind_of_cpu():
    """A short name of the processor and of the flags that decide for which instructions XLA compiles."""
    described = platform.machine() + platform.processor() + os.environ["XLA_FLAGS"]
    info = Path("/proc/cpuinfo")
    if info.exists():  # the first processor, without the lines of its clock
        lines = info.read_text().split("\n\n")[0].splitlines()
        described += "".join(line for line in lines if line.startswith(("model name", "flags", "Features")))
    return hashlib.sha256(described.encode()).hexdigest()[:12]


if not jax.config.jax_compilation_cache_dir:  # JAX_COMPILATION_CACHE_DIR decides otherwise
    # A program compiled for one processor is wrong or an error on another, so that each kind has its own.
    jax.config.update("jax_compilation_cache_dir", str(ROOT / ".pytest_cache" / f"jax-{kind_of_cpu()}"))
    # what compiles faster than this is not faster read
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)

SHARED = Path(__file__).resolve().parents[2] / "shared"


def pytest_collection_finish():
    """What is imported stays, and so does most of what is traced: collections of garbage were a tenth of the time.

    With these thresholds, the first thirty times that of Python, they are a fiftieth.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 10, 10)


@pytest.fixture
def key():
    return jax.random.key(20261121)


@pytest.fixture(scope="module", autouse=True)
def compilation(request):
    """The rooms run large programs once on little data: half the time to compile, several times that to run.

    In tests/validation programs are those that users run.
    """
    jax.config.update("jax_disable_most_optimizations", "validation" not in request.path.parts)


@pytest.fixture(scope="module")
def quick_compilation(compilation):
    """For files of tests/validation that are like those of the rooms."""
    jax.config.update("jax_disable_most_optimizations", True)


MAX_BYTES, MAX_MAPS = 3e9, 30_000
"""Of one process: of memory, and of memory maps, of which Linux allows 65,530 and a compiled program takes several."""


def is_full():
    """Whether compiled programs have used up what one process should hold; where nobody knows, it is."""
    process = Path("/proc/self")
    if not process.exists():
        return True
    num_bytes = int((process / "statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    with (process / "maps").open("rb") as maps:
        return num_bytes > MAX_BYTES or sum(1 for _ in maps) > MAX_MAPS


@pytest.fixture(scope="module", autouse=True)
def compiled_programs_do_not_pile_up():
    """Thousands in one process end in a crash of the compiler; until then files share them, more than users keep."""
    from gmwm_jax._internal import programs

    programs.MAX_PROGRAMS = sys.maxsize
    yield
    if is_full():
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
