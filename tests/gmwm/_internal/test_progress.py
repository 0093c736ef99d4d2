"""Progress is a bar on a terminal, a line now and then elsewhere, or a call of the user's, who may cancel by it."""

import sys
from types import SimpleNamespace

import pytest

from gmwm_jax._internal import progress
from gmwm_jax._internal.progress import progress_bar


def test_nothing_is_shown_unless_it_is_wanted(capsys):
    bar = progress_bar(3, "run", False)
    bar.update(3)
    bar.close()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("total", [5, None])
def test_a_function_is_told(total):
    told = []
    bar = progress_bar(total, "run", lambda done, of: told.append((done, of)))
    bar.update(2)
    bar.update(3)
    bar.close()
    assert told == [(0, total), (2, total), (5, total)]


def test_a_function_cancels_by_raising():
    def tell(done, total):
        if done >= 2:
            raise RuntimeError("enough")

    bar = progress_bar(5, "run", tell)
    bar.update(1)
    with pytest.raises(RuntimeError, match="enough"):
        bar.update(1)


@pytest.mark.parametrize(
    ("total", "unit", "text"), [(9, "run", "6 of 9 runs after 70 s"), (None, "B", "6 B after 70 s")]
)
def test_without_a_terminal_there_is_a_line_now_and_then(monkeypatch, capsys, total, unit, text):
    clock = iter([100.0, 110.0, 125.0, 170.0, 171.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    bar = progress_bar(total, unit, True)
    for n in (1, 2, 3, 1):
        bar.update(n)
    bar.close()
    assert capsys.readouterr().err == f"{text}\n"


@pytest.mark.parametrize("where", ["terminal", "notebook"])
def test_a_bar_needs_its_package(monkeypatch, where):
    monkeypatch.setitem(sys.modules, "tqdm", None)
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(isatty=lambda: where == "terminal"))
    if where == "notebook":
        monkeypatch.setitem(sys.modules, "ipykernel", SimpleNamespace())
    else:
        monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    with pytest.raises(ImportError, match=r"gmwm-jax\[app\]"):
        progress_bar(3, "run", True)
