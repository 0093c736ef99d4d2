"""Haar wavelet variance at all octaves beside allantools.oadev: time, memory, and digits.

The peer is `allantools.oadev(x, rate=1, data_type="freq", taus="octave")`, run in the same process, in turn.
"""

import json
import sys
import tempfile
import threading
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)
import allantools
import jax.numpy as jnp
import numpy as np
from common import Report, compilations, fresh, interleaved, median_process, repeated, seconds, timed

import gmwm_jax as gj

R_SECONDS = {10**5: 0.028, 10**6: 0.498}
"""R's wv::wvar (MODWT, Haar) on 2 cores, from the project's notes on the R packages; not run here."""


def record(num: int, seed: int = 0) -> np.ndarray:
    """White noise and a random walk around an offset: coarse scales matter, and the mean is not zero."""
    rng = np.random.default_rng(seed)
    return 0.4 + rng.standard_normal(num) + np.cumsum(1e-3 * rng.standard_normal(num))


def oadev(x: np.ndarray) -> np.ndarray:
    """allantools' overlapping Allan deviation as wavelet variance: nu_j^2 = AVAR(2^(j-1))/2."""
    return allantools.oadev(x, rate=1, data_type="freq", taus="octave")[1] ** 2 / 2


def brute_force(x: np.ndarray, num_levels: int) -> np.ndarray:
    """The definition in long double: every window summed afresh."""
    y, result = x.astype(np.longdouble), []
    for j in range(1, num_levels + 1):
        windows = np.lib.stride_tricks.sliding_window_view(y, 2**j)
        half = 2 ** (j - 1)
        w = (windows[:, half:].sum(axis=1) - windows[:, :half].sum(axis=1)) / np.longdouble(2**j)
        result.append(np.mean(w * w))
    return np.array(result)


def by_cumulative_sums(x: np.ndarray, num_levels: int) -> np.ndarray:
    """In long double for long records: window sums as differences of cumulative sums."""
    c = np.concatenate([[0], np.cumsum(x.astype(np.longdouble) - np.longdouble(x.mean()))])
    result = []
    for j in range(1, num_levels + 1):
        n = 2 ** (j - 1)
        w = (c[2 * n :] - 2 * c[n:-n] + c[: -2 * n]) / np.longdouble(2 * n)
        result.append(np.mean(w * w))
    return np.array(result)


def error(a: np.ndarray, b: np.ndarray) -> str:
    """Largest relative difference over the scales that both have."""
    J = min(len(a), len(b))
    return f"{float(np.max(np.abs(a[:J] / b[:J] - 1))):.1e}"


# -- out of memory: child processes that watch their own memory --------------------------------------------------------


class AnonymousPeak:
    """Highest anonymous memory (MiB) meanwhile: pages of mapped files, which the system may drop, do not count."""

    def __enter__(self) -> "AnonymousPeak":
        self.start = self.peak = self._now()
        self.done = threading.Event()
        self.thread = threading.Thread(target=self._watch)
        self.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.done.set()
        self.thread.join()

    def _watch(self) -> None:
        while not self.done.wait(1e-3):
            self.peak = max(self.peak, self._now())

    @staticmethod
    def _now() -> float:
        status = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in status if line.startswith("RssAnon")).split()[1]) / 1024


def child(way: str, file: str) -> None:
    x = np.memmap(file, dtype=np.float64, mode="r")
    with tempfile.TemporaryDirectory(dir=Path(file).parent) as scratch, AnonymousPeak() as memory:
        if way == "array":
            loaded = np.array(x)
            took, wv = timed(lambda: gj.wavelet_variance(loaded))
        elif way == "memmap":
            took, wv = timed(lambda: gj.wavelet_variance(x))
        elif way == "memmap, scratch":
            took, wv = timed(lambda: gj.wavelet_variance(x, scratch=scratch))
        else:
            took, wv = timed(
                lambda: gj.wavelet_variance((x[i : i + 100_000] for i in range(0, len(x), 100_000)), scratch=scratch)
            )
    print(json.dumps({"seconds": took, "mib": memory.peak - memory.start, "variance": wv.variance.tolist()}))


# -- the tables --------------------------------------------------------------------------------------------------------


def main() -> None:
    report = Report("wavelet", __doc__)
    repeats = 3 if report.quick else 11
    sizes = (10**4, 10**5) if report.quick else (10**5, 10**6, 10**7)
    middle = sizes[1]

    rows = []
    for num in sizes:
        x = record(num)
        times = interleaved(
            {"ours": lambda x=x: gj.wavelet_variance(x), "peer": lambda x=x: oadev(x)},
            repeats if num < 10**7 else max(repeats // 2, 1),
        )
        ours, peer = times["ours"], times["peer"]
        wv, exact = gj.wavelet_variance(x), by_cumulative_sums(x, len(oadev(x)))
        ratio = f"{ours.median / peer.median:.2f}"
        r = R_SECONDS.get(num)
        rows.append(
            [f"{num:.0e}", ours, peer, ratio, f"{r} s" if r else "", error(wv.variance, exact), error(oadev(x), exact)]
        )
        if num == middle:
            bar_note = f"{seconds(peer.median)} allantools; R 0.498 s (quoted)"
            report.bar(
                f"WV, {num:.0e} samples, all octaves", "<= 0.5 x allantools", seconds(ours.median), bar_note, ratio
            )
    report.table(
        "One channel: `gj.wavelet_variance(array)`, median (range)",
        ["N", "ours", "allantools", "ratio", "R wv (quoted, 2 cores)", "our rel. error", "allantools' rel. error"],
        rows,
    )

    six = np.column_stack([record(middle, seed) for seed in range(6)])
    by_channel = np.asfortranarray(six)
    times = interleaved(
        {
            "(N, 6), row by row": lambda: gj.wavelet_variance(six),
            "(N, 6), channel by channel (as `Recording` stores it)": lambda: gj.wavelet_variance(by_channel),
            "allantools, six calls": lambda: [oadev(by_channel[:, i]) for i in range(6)],
        },
        max(repeats // 2, 2),
    )
    peer = times["allantools, six calls"].median
    report.table(
        f"Six channels, N = {middle:.0e}",
        ["", "median (range)", "ratio to allantools"],
        [[name, t, f"{t.median / peer:.2f}"] for name, t in times.items()],
    )

    x = record(middle)
    device = jnp.asarray(x)
    traced = jax.jit(gj.variance.haar_wavelet_variance)
    with compilations() as compiled:
        traced(device).block_until_ready()
    run = repeated(lambda: traced(device), repeats)
    gradient = jax.jit(jax.grad(lambda y: jnp.sum(jnp.log(gj.variance.haar_wavelet_variance(y)))))
    with compilations() as compiled_gradient:
        gradient(device).block_until_ready()
    run_gradient = repeated(lambda: gradient(device), max(repeats // 2, 2))
    exact = by_cumulative_sums(x, gj.wavelet_variance(x).num_scales)
    report.table(
        f"JAX path, `jax.jit(gj.variance.haar_wavelet_variance)`, N = {middle:.0e}",
        ["", "XLA compile", "run, median (range)", "rel. error"],
        [
            ["value", seconds(compiled.seconds), run, error(np.asarray(traced(device)), exact)],
            ["gradient of sum log nu_j^2", seconds(compiled_gradient.seconds), run_gradient, ""],
        ],
    )

    subset = record(2**13 + 1234, seed=7)
    J = gj.wavelet_variance(subset).num_scales
    truth = brute_force(subset, J)
    report.table(
        f"Largest relative error over {J} scales against the definition in long double, N = {len(subset)}",
        ["path", "error"],
        [
            ["host (NumPy, blocks)", error(gj.wavelet_variance(subset).variance, truth)],
            ["JAX", error(np.asarray(gj.variance.haar_wavelet_variance(jnp.asarray(subset))), truth)],
            ["allantools", error(oadev(subset), truth)],
            ["(the check itself: cumulative sums in long double)", error(by_cumulative_sums(subset, J), truth)],
        ],
    )

    largest, rows = sizes[-1], []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "record.f64"
        record(largest).tofile(file)
        exact = by_cumulative_sums(record(largest), gj.wavelet_variance(record(largest)).num_scales)
        for way in ("array", "memmap", "memmap, scratch", "blocks, scratch"):
            runs = [fresh(__file__, "--child", way, file) for _ in range(1 if report.quick else 3)]
            one = median_process(runs)
            answer = one.answer
            rows.append([way, seconds(answer["seconds"]), f"{answer['mib']:.0f} MiB", f"{one.peak_mib:.0f} MiB"])
            rows[-1].append(error(np.array(answer["variance"]), exact))
    megabytes = 8 * largest / 2**20
    report.table(
        f"Out of memory: one channel, N = {largest:.0e} ({megabytes:.0f} MiB), fresh processes",
        ["record", "time", "anonymous memory added", "peak RSS (with mapped pages)", "rel. error"],
        rows,
    )
    report.say(
        "Anonymous memory is what the process cannot give back; mapped pages of the record and of the scratch file "
        "also count into the RSS while memory is free. 'array' includes the running sums, but not the record itself."
    )
    report.save()


if __name__ == "__main__":
    child(*sys.argv[2:]) if "--child" in sys.argv else main()
