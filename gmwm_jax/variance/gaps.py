"""Haar wavelet variance of records with missing samples, by pairs of samples; O(N log N) a level.

Few windows are complete when samples are missing here and there. But the Haar wavelet variance is linear in the
semivariogram G(k) = E(x_{t+k} - x_t)^2 / 2,

    nu_j^2 = -2 sum_{k=1}^{tau_j - 1} r_j(k) G(k),    r_j(k) = [2 (n - k)_+ - (n - |k - n|)_+] / tau_j^2,

r_j the autocorrelation of the filter, n = tau_j/2, and G(k) can be had from the pairs at lag k that are there (Mondal &
Percival 2010). With weights Q_j(s, s') of the pairs that add up to r_j(k) at every lag,

    nu_j^2 = -sum_{s < s'} Q_j(s, s') (x_s - x_s')^2 = x' Q_j x,    rows of Q_j adding up to zero,

has the expectation nu_j^2 whatever is missing, as long as that does not depend on the record. It can be negative.

The weights. In a complete record of which M_j windows are averaged, a pair has the weight u/M_j with u = r_j(k) inside,
and r_j(k) - D(s, s') where s and s' both lie within a span of an end, for some of the windows that hold them would
leave the record. The same weight for all pairs, r_j(k)/pairs(k), is unbiased as well, but where white noise is seen
at long spans its ends alone scatter thousands of times more. Hence, with <D>_k the mean over the pairs that are there,

    Q_j(s, s') = r_j(k)/pairs(k) + [<D>_k - D(s, s')] (N - k)/(M_j pairs(k)),

which is the MODWT if nothing is missing, and unbiased if something is. From the ends, D tau_j^2 = alpha(s) + beta(s')
for k < n and gamma(s') beyond, s < s' counted from the nearer end, so that all is done by Fourier transforms.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float
from numpy import fft
from scipy.fft import next_fast_len

from gmwm_jax._internal.checks import present_samples
from gmwm_jax.variance.haar import check_num_levels, degrees_of_freedom, scales


class PairCounts(NamedTuple):
    """Where samples are, and what all channels and replicates with the same missing samples share."""

    present: Bool[np.ndarray, " N"]
    """False where a sample is missing."""
    spectrum: Complex[np.ndarray, " F"]
    """Fourier transform of `present`, padded to `size`."""
    counts: Float[np.ndarray, " L"]
    """Pairs of samples at the lags 0 .. 2^J - 1."""
    size: int
    """Of Fourier transforms, even, at least N + 2^J: nothing wraps around."""

    @property
    def num_levels(self) -> int:
        """J."""
        return len(self.counts).bit_length() - 1

    @property
    def num_samples(self) -> int:
        """N, the missing ones included."""
        return len(self.present)


class Weights(NamedTuple):
    """The weights Q_j of one level: what depends on the lag only, less what differs at the ends."""

    by_lag: Float[np.ndarray, " T"]
    """At the lags 0 (where it is zero) .. tau_j - 1."""
    alpha: Float[np.ndarray, " T"]
    beta: Float[np.ndarray, " T"]
    gamma: Float[np.ndarray, " T"]
    near: Complex[np.ndarray, " K"]
    """Fourier transform of (N - k)/(M_j pairs(k)) at the lags 1 .. n - 1."""
    far: Complex[np.ndarray, " K"]
    """The same at the lags n .. tau_j - 1."""

    def at_an_end(self, v: Float[np.ndarray, "B T"]) -> Float[np.ndarray, "B T"]:
        """What differs, times the samples within a span of an end, counted from there."""
        tau = len(self.alpha)

        def forward(a: np.ndarray) -> np.ndarray:
            return fft.rfft(a, 2 * tau)

        def back(a: np.ndarray) -> np.ndarray:
            return fft.irfft(a, 2 * tau)[..., :tau]

        V, from_later, from_earlier = forward(v), self.near.conj(), self.near
        both = from_later * forward(self.beta * v) + from_earlier * forward(self.alpha * v)
        both += self.far.conj() * forward(self.gamma * v)
        own = self.alpha * back(from_later * V) + self.beta * back(from_earlier * V) + self.gamma * back(self.far * V)
        return back(both) + own


def variance_by_pairs(
    columns: Float[np.ndarray, "N *C"], names: Sequence[str], num_levels: int | None = None
) -> tuple[Float[np.ndarray, "J *C"], Float[np.ndarray, "J *C"]]:
    """Wavelet variance of channels with missing samples, and its degrees of freedom.

    Parameters
    ----------
    columns
        NaN where a sample is missing.
    names
        Of the channels, for messages.
    num_levels
        J. By default as many as all channels have, see `find_pairs`, below the first variance that is not positive.

    Raises
    ------
    ValueError
        An infinite sample; fewer than 4 samples; a constant channel; gaps that leave too little for J levels.
    """
    results, last = [], None
    for x, name in zip(columns.reshape(len(columns), -1).T, names, strict=True):
        present = present_samples(x, name)
        if last is None or not np.array_equal(present, last[0].present):
            pairs = find_pairs(present, num_levels)
            last = pairs, white_widening(pairs)
        pairs, white = last
        if np.min(x[present]) == np.max(x[present]):
            raise ValueError(f"{name} does not change: a constant or stuck channel has no noise to model.")
        nu = gap_wavelet_variance(x[None], pairs)[0]
        J = positive_levels(nu)
        asked = 1 if num_levels is None else num_levels
        if asked > J:
            raise ValueError(
                f"{name}: from the {np.sum(present)} samples that are there, the wavelet variance at the span of "
                f"{2 << J} samples is not positive. The gaps leave too little, or the samples are coarsely quantised: "
                f"there are {J} levels, and not {asked}."
            )
        results.append((nu[:J], gap_degrees_of_freedom(pairs, nu[:J], white)))
    J = min(len(nu) for nu, _ in results)
    nu, eta = (np.column_stack([r[i][:J] for r in results]).reshape(J, *columns.shape[1:]) for i in range(2))
    return nu, eta


def find_pairs(present: Bool[np.ndarray, " N"], num_levels: int | None = None) -> PairCounts:
    """Count the pairs of samples that are there.

    Parameters
    ----------
    present
        False where a sample is missing.
    num_levels
        J. By default that of a record of as many samples as are there, or less where a lag below 2^J has no pair.

    Raises
    ------
    ValueError
        Fewer than 4 samples; a J that is too large, or with a lag below 2^J that has no pair.
    """
    J, num = check_num_levels(int(np.sum(present)), num_levels), len(present)
    size = 2 * next_fast_len((num + 2**J + 1) // 2, real=True)  # type: ignore[operator]
    spectrum = fft.rfft(present.astype(np.float64), size)
    counts = np.rint(fft.irfft(np.abs(spectrum) ** 2, size)[: 2**J])
    unseen = np.flatnonzero(counts == 0)
    if len(unseen):
        lag = int(unseen[0])
        if num_levels is not None or lag == 1:
            raise ValueError(
                f"No two of the {np.sum(present)} samples that are there lie {lag} samples apart: there are "
                f"{lag.bit_length() - 1} levels, and not {J}."
            )
        counts = counts[: 1 << (lag.bit_length() - 1)]
    return PairCounts(present, spectrum, counts, size)


def gap_wavelet_variance(records: Float[np.ndarray, "B N"], pairs: PairCounts) -> Float[np.ndarray, "B J"]:
    """Wavelet variance of records with missing samples.

    Parameters
    ----------
    records
        Finite where a sample is present, which is at the same times in all.
    pairs
        Of `find_pairs`.

    Returns
    -------
    nu_j^2 at the spans 2, 4, .. 2^J, negative by chance where gaps leave too little.
    """
    x = _centred(records, pairs)
    squares, power = fft.rfft(x * x, pairs.size), np.abs(fft.rfft(x, pairs.size)) ** 2
    # the sum over pairs of (x_{t+k} - x_t)^2
    differences = fft.irfft(2 * (pairs.spectrum.conj() * squares).real - 2 * power, pairs.size)
    columns = []
    for level in range(1, pairs.num_levels + 1):
        weights, tau = pair_weights(pairs, level), 1 << level
        rows = [weights.at_an_end(v) for v in _ends(pairs.present[None].astype(np.float64), tau)]
        ends = [
            np.sum(v * (v * row - weights.at_an_end(v)), axis=1) for v, row in zip(_ends(x, tau), rows, strict=True)
        ]
        columns.append(sum(ends) - differences[:, :tau] @ weights.by_lag)
    return np.stack(columns, axis=1)


def quadratic_forms_times(records: Float[np.ndarray, "B N"], pairs: PairCounts) -> Iterator[Float[np.ndarray, "B N"]]:
    """Q_1 x .. Q_J x for each record x; arguments as of `gap_wavelet_variance`, which is x' Q_j x."""
    present = pairs.present[None].astype(np.float64)
    x = np.concatenate([present, _centred(records, pairs)])
    for y in _off_diagonals_times(x, pairs):
        yield np.where(pairs.present, y[1:] - y[0] * x[1:], 0.0)


def _off_diagonals_times(x: Float[np.ndarray, "B N"], pairs: PairCounts) -> Iterator[Float[np.ndarray, "B N"]]:
    """The same without the diagonal, also where samples are missing."""
    spectra = fft.rfft(x, pairs.size)
    for level in range(1, pairs.num_levels + 1):
        weights, tau = pair_weights(pairs, level), 1 << level
        kernel = np.zeros(pairs.size)
        kernel[:tau] = weights.by_lag
        kernel[1 - tau :] = weights.by_lag[:0:-1]
        y = fft.irfft(fft.rfft(kernel).real * spectra, pairs.size)[:, : pairs.num_samples]
        first, last = (weights.at_an_end(v) for v in _ends(x, tau))
        y[:, :tau] -= first
        y[:, -tau:] -= last[:, ::-1]
        yield y


def positive_levels(nu: Float[np.ndarray, "J *C"]) -> int:
    """How many levels to keep: those below the first whose variance is not positive, in any channel."""
    good = np.all(nu > 0, axis=tuple(range(1, nu.ndim)))
    return len(good) if np.all(good) else int(np.argmin(good))


def gap_degrees_of_freedom(
    pairs: PairCounts, nu: Float[np.ndarray, " J"], white: Float[np.ndarray, " L"]
) -> Float[np.ndarray, " J"]:
    """Degrees of freedom of nu_j^2: those of the complete record ("eta 3") over the widening by gaps.

    The widening is that of white noise, which bounds that of noise with more power at long spans from above. Where
    power falls faster than that of white noise, pairs of single samples bring the power of the short spans into long
    ones: the excess then grows with its square, (sum_{i<=j} nu_i^2)^2, which is nu_j^4 (tau_j - 1)^2 for white noise.

    Parameters
    ----------
    pairs
        Of `find_pairs`.
    nu
        Wavelet variances of the first levels, positive.
    white
        `white_widening` of these pairs.
    """
    J = len(nu)
    short = np.cumsum(nu) / ((scales(J) - 1) * nu)
    excess = (white[:J] - 1) * np.maximum(short**2, 1.0)
    return np.maximum(degrees_of_freedom(pairs.num_samples, J) / (1 + excess), 1.0)


def white_widening(pairs: PairCounts) -> Float[np.ndarray, " J"]:
    """By what gaps multiply the variance of nu_j^2 of white noise, 2 sum_st Q_j(s, t)^2.

    What is special to the ends counts in the diagonal only.
    """
    result = []
    for level, rows in enumerate(_off_diagonals_times(pairs.present[None].astype(np.float64), pairs), 1):
        r, M = _autocorrelation(level), pairs.num_samples - (1 << level) + 1
        with_gaps = 2 * np.sum(r[1:] ** 2 / pairs.counts[1 : len(r)]) + np.sum(rows[0, pairs.present] ** 2)
        inside = np.maximum(1 - np.arange(len(r)) / M, 0.0)
        result.append(with_gaps * M / (2 * np.dot(r**2, inside) - r[0] ** 2))
    return np.maximum(result, 1.0)


def pair_weights(pairs: PairCounts, level: int) -> Weights:
    """The weights of a level."""
    tau, num = 1 << level, pairs.num_samples
    n, k, M = tau // 2, np.arange(tau), num - tau + 1
    counts = np.maximum(pairs.counts[:tau], 1.0)
    scale = np.where(k > 0, (num - k) / (M * counts), 0.0)
    beyond = 2 * np.maximum(k + 1 - n, 0)
    alpha, beta, gamma = ((2 * k - 1 - beyond) / tau**2, (tau - 3 * k + beyond) / tau**2, (k + 1 - tau) / tau**2)
    near, far = (fft.rfft(np.where(inside, scale, 0.0), 2 * tau) for inside in (k < n, k >= n))
    # the mean of D over the pairs of each lag
    V, A, B, C = (
        fft.rfft(w * np.concatenate(_ends(pairs.present[None], tau)), 2 * tau)
        for w in (np.ones(tau), alpha, beta, gamma)
    )
    sums = [fft.irfft(np.sum(s, axis=0), 2 * tau)[:tau] for s in (A.conj() * V + V.conj() * B, V.conj() * C)]
    by_lag = np.where(k > 0, _autocorrelation(level), 0.0) / counts + scale * np.where(k < n, *sums) / counts
    return Weights(by_lag, alpha, beta, gamma, near, far)


def _autocorrelation(level: int) -> Float[np.ndarray, " T"]:
    """r_j(k) of the filter at the lags 0 .. tau_j - 1."""
    n, k = 1 << (level - 1), np.arange(1 << level)
    return (2 * np.maximum(n - k, 0) - np.maximum(n - np.abs(k - n), 0)) / (2.0 * n) ** 2


def _centred(records: Float[np.ndarray, "B N"], pairs: PairCounts) -> Float[np.ndarray, "B N"]:
    """Zero where a sample is missing: a constant changes nothing, and without it the sums stay small."""
    mean = np.mean(records, axis=1, keepdims=True, where=pairs.present)
    return np.where(pairs.present, records - mean, 0.0)


def _ends(x: np.ndarray, tau: int) -> tuple[np.ndarray, np.ndarray]:
    """The samples within a span of either end, counted from there."""
    return x[:, :tau], x[:, : -tau - 1 : -1]
