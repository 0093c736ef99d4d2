"""Results draw themselves by the figures of their package, without pyplot and from several threads."""

import inspect
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import gmwm_jax as gj
import nav_jax as nj
from gmwm_jax._internal.channels import Channels
from gmwm_jax._internal.drawing import Drawable, registry

ROOT = Path(__file__).resolve().parents[3]


def variances(seed=0):
    return gj.wavelet_variance(np.random.default_rng(seed).standard_normal(256), rate=10.0 ** (seed % 7), unit="rad/s")


def png(figure):
    file = BytesIO()
    figure.savefig(file, format="png", bbox_inches="tight", dpi=50)
    return file.getvalue()


def drawables(package):
    """All classes of a package that draw themselves."""
    found, todo = [], [Drawable]
    while todo:
        below = todo.pop().__subclasses__()
        found += [c for c in below if c.__module__.startswith(f"{package}.")]
        todo += below
    return found


@pytest.mark.parametrize(("package", "least"), [(gj, 14), (nj, 9)])
def test_every_result_that_draws_itself_has_a_figure(package, least):
    results = drawables(package.__name__)
    assert len(results) >= least
    for result in results:
        assert package.plotting.draw.dispatch(result) is not package.plotting.draw.dispatch(object), result


@pytest.mark.parametrize("package", [gj, nj])
def test_options_of_a_figure_are_seen_in_help(package):
    """Every one by its name, with the default of the function that draws, and described."""
    for result in drawables(package.__name__):
        if result is Channels:  # of several figures
            continue
        _, *wanted = inspect.signature(package.plotting.draw.dispatch(result)).parameters.values()
        _, *found = inspect.signature(result.plot).parameters.values()
        assert [(p.name, p.default, p.kind) for p in found] == [(p.name, p.default, p.kind) for p in wanted], result
        assert "axes" in {p.name for p in found}
        assert not any(p.kind == p.VAR_KEYWORD for p in found)
        for p in found:
            assert f"\n{p.name}\n    " in inspect.cleandoc(result.plot.__doc__), (result, p.name)


def test_several_channels_have_the_options_of_any():
    _, *found = inspect.signature(Channels.plot).parameters.values()
    figures = [name for name in dir(gj.plotting) if name in ("plot_fits", "plot_selections", "plot_joint_fits")]
    known = {p for name in figures for p in list(inspect.signature(getattr(gj.plotting, name)).parameters)[1:]}
    assert {p.name for p in found} == known == {"datasheet", "axes"}


@pytest.mark.parametrize("package", [gj, nj])
def test_every_figure_has_its_data(package):
    names = {n.removeprefix("plot_") for n in dir(package.plotting) if n.startswith("plot_")}
    assert names == {n.removesuffix("_data") for n in dir(package.plotting) if n.endswith("_data")}


def test_options_are_those_of_the_function():
    wv = variances()
    with pytest.raises(TypeError, match="got an unexpected keyword argument 'colour'"):
        wv.plot(colour="red")
    with pytest.raises(
        TypeError, match="gmwm_jax has no figure of a int, only of AbstractWaveletVariance, AllanDeviation, Bootstrap"
    ):
        gj.plotting.draw(7)


def test_a_subclass_of_somebody_else_is_drawn_as_what_it_extends():
    class Mine(gj.variance.WaveletVariance):
        pass

    wv = variances()
    mine = Mine(**{name: getattr(wv, name) for name in wv.__dataclass_fields__})
    assert png(mine.plot()) == png(wv.plot())


def test_the_closest_class_is_drawn():
    draw = registry("somewhere")
    draw.register(int)(lambda x, **options: ("int", x, options))
    assert draw(True, axes=1) == ("int", True, {"axes": 1})
    with pytest.raises(TypeError, match="somewhere has no figure of a str, only of int"):
        draw("text")


def test_the_doors_have_no_other_names():
    for package in (gj, nj):
        with pytest.raises(AttributeError, match=f"module '{package.__name__}' has no attribute 'ploting'"):
            package.ploting  # noqa: B018


@pytest.mark.slow
def test_figures_from_several_threads_are_those_of_one():
    """Ticks on logarithmic axes are formulas, and Matplotlib has one parser of them."""
    results = [variances(seed) for seed in range(12)]
    alone = [png(wv.plot()) for wv in results]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        with ThreadPoolExecutor(4) as threads:
            together = list(threads.map(lambda wv: png(wv.plot()), results))
    finally:
        sys.setswitchinterval(before)
    assert together == alone
    assert len(set(alone)) == len(alone)


def test_only_one_thread_draws_at_a_time(monkeypatch):
    inside, most, draw = [], [], Figure.draw

    def slow(self, renderer):
        inside.append(self)
        most.append(len(inside))
        time.sleep(0.02)
        draw(self, renderer)
        inside.remove(self)

    monkeypatch.setattr(Figure, "draw", slow)
    plots = [variances(seed).plot() for seed in range(3)]
    with ThreadPoolExecutor(3) as threads:
        list(threads.map(lambda figure: figure.canvas.draw(), plots))
    assert most == [1, 1, 1]


def test_a_notebook_shows_a_figure():
    figure = variances().plot()
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert "_repr_png_" in dir(figure)


@pytest.mark.slow
def test_pyplot_is_not_imported(tmp_path):
    """In a fresh process that draws, saves, and asks for the figure as a notebook does."""
    program = """
import jax, sys
jax.config.update("jax_enable_x64", True)
import gmwm_jax as gj, nav_jax as nj, numpy as np
assert "matplotlib" not in sys.modules
wv = gj.wavelet_variance(np.random.default_rng(0).standard_normal(64))
figure = wv.plot()
figure.savefig(sys.argv[1])
figure._repr_png_()
nj.motions.circle(5.0).plot().savefig(sys.argv[1])
import gmwm_jax.app.cli, nav_jax.app.cli
print("matplotlib" in sys.modules, "matplotlib.pyplot" in sys.modules)
"""
    command = [sys.executable, "-c", program, tmp_path / "figure.pdf"]
    seen = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert seen.stdout.strip() == "True False"
