"""Compiled programs that are kept: by whom they can be read, who decides, and that the next process finds them."""

import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor

import jax
import pytest

from gmwm_jax._internal import compiled
from gmwm_jax._internal.executors import processes


@pytest.fixture
def changed(monkeypatch):
    """Settings of JAX that would be changed, where nobody has decided yet."""
    changed = {}
    monkeypatch.setattr(compiled.jax.config, "update", changed.__setitem__)
    monkeypatch.setattr(compiled.compilation_cache, "reset_cache", lambda: None)
    monkeypatch.setattr(compiled, "_decided", lambda: False)
    return changed


def test_compiled_programs_are_their_owners(tmp_path, changed):
    folder = compiled.keep_compiled(tmp_path)
    assert changed["jax_compilation_cache_dir"] == str(folder)
    assert folder.stat().st_mode & 0o777 == folder.parent.stat().st_mode & 0o777 == 0o700


def test_who_has_decided_stays(tmp_path):
    assert jax.config.jax_compilation_cache_dir  # that of these tests
    assert compiled.keep_compiled(tmp_path) is None


def test_a_folder_of_somebody_else_is_refused(tmp_path, changed, monkeypatch):
    mine = os.getuid()
    monkeypatch.setattr(compiled.os, "getuid", lambda: mine + 1)
    with pytest.raises(PermissionError, match="somebody else"):
        compiled.keep_compiled(tmp_path)
    assert not changed
    monkeypatch.setattr(compiled, "keep_compiled", lambda: (_ for _ in ()).throw(PermissionError("no")))
    compiled.kept_if_possible()


def test_the_oldest_go_first(tmp_path, changed, monkeypatch):
    for i in range(6):
        file = tmp_path / "compiled" / "other" / f"p{i}"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(bytes(100))
        os.utime(file, (1000 + i, 1000 + i))
    monkeypatch.setattr(compiled, "_MOST_BYTES", 250)
    compiled.keep_compiled(tmp_path)
    assert sorted(f.name for f in (tmp_path / "compiled" / "other").iterdir()) == ["p4", "p5"]


SCRIPT = """
import sys, jax
jax.config.update("jax_enable_x64", True)
jax.jit(lambda x: x + 1)(1.0)  # JAX has compiled before
import gmwm_jax as gj, jax.numpy as jnp
from pathlib import Path
before = jax.config.jax_compilation_cache_dir
folder = gj.keep_compiled(Path(sys.argv[1]))
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
hits = []
jax.monitoring.register_event_listener(lambda name, **_: hits.append(name) if name.endswith("cache_hits") else None)
jax.jit(lambda x: jnp.linalg.cholesky(x @ x.T + jnp.eye(7)))(jnp.ones((7, 7)))
print(before, folder is not None, len(hits), len(list(folder.iterdir())) if folder else 0)
"""


def started(folder, **environment):
    clean = {k: v for k, v in os.environ.items() if not k.startswith("JAX_")}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(folder)], env=clean | environment, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


@pytest.mark.slow
def test_the_next_process_finds_them(tmp_path):
    before, kept, hits, files = started(tmp_path)
    assert (before, kept, hits) == ("None", "True", "0")
    assert int(files) > 0
    assert int(started(tmp_path)[2]) > 0
    # damaged ones are compiled again
    for file in tmp_path.glob("compiled/*/*"):
        file.write_bytes(b"no program")
    assert started(tmp_path)[1:3] == ["True", "0"]
    assert started(tmp_path / "other", JAX_ENABLE_COMPILATION_CACHE="0")[1:3] == ["False", "0"]


def folder_of_worker():
    return jax.config.jax_compilation_cache_dir


@pytest.mark.slow
def test_workers_keep_them_too(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    with processes(1)() as pool:
        assert isinstance(pool, ProcessPoolExecutor)
        assert str(tmp_path) in pool.submit(folder_of_worker).result()
