"""The table of processes that every test of a process runs over, and what is computed from it at 80 digits.

A row holds the *definition* of a process, none of the code's formulas: the autocovariance of the process, or of its
first difference where only that is stationary. Wavelet variances, covariance matrices and means follow from it by
sums. `closed_form` is the textbook formula; a test holds it against the sums where they are quick, and it serves for
spans up to 2^24. One more process is one more row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate, repeat
from typing import Any

import mpmath
import numpy as np
import pytest
import scipy.linalg

from gmwm_jax.processes.arma import AR, ARMA, MA
from gmwm_jax.processes.band_flicker import FLK
from gmwm_jax.processes.base import AbstractProcess
from gmwm_jax.processes.drift import DR
from gmwm_jax.processes.flicker import BI
from gmwm_jax.processes.fractional import FGN
from gmwm_jax.processes.gauss_markov import AR1, GM
from gmwm_jax.processes.matern import MAT32, MAT52
from gmwm_jax.processes.quantisation import QN
from gmwm_jax.processes.random_walk import RW
from gmwm_jax.processes.sinusoid import SIN
from gmwm_jax.processes.white_noise import WN

MP = mpmath.mp.clone()
"""A context of its own: no other test changes its precision. The closed form of GM loses 3 log10(1/beta) digits."""
MP.dps = 80


@dataclass(frozen=True)
class Case:
    """One process: its class, parameter sets, and what it is by definition."""

    cls: type[AbstractProcess]
    parameters: tuple[tuple[float, ...], ...]
    """Sets of parameters, in the order of the class."""
    outside: tuple[tuple[float, ...], ...]
    """Sets that the constructor must refuse."""
    closed_form: Callable[..., Any]
    """(parameters..., tau) -> Haar wavelet variance, in mpmath."""
    autocovariance: Callable[..., list[Any]]
    """(parameters..., num) -> autocovariance at the lags 0 .. num - 1 of the process after `differences`."""
    psd: Callable[..., Any] | None
    """(parameters..., frequency) -> two-sided PSD, in mpmath; None where there is none."""
    differences: int = 0
    """0: stationary; 1: its first difference is (with x_0 = 0)."""
    mean: Callable[..., Any] = lambda *parameters: MP.mpf(0)
    """Mean of the process after `differences`."""
    gaussian: bool = True
    rtol: float = 1e-13
    """What the wavelet variance keeps."""
    second_derivatives_rtol: float = 1e-9
    covariance_rtol: float = 1e-10
    """What the covariance of the wavelet variance of 300 samples keeps."""
    short_memory: Callable[..., bool] = lambda *parameters: True
    """Has the correlation of this parameter set died out, to 1e-11, after 2^19 samples?"""

    @property
    def ergodic(self) -> bool:
        return self.cls.ergodic

    @property
    def stationary(self) -> bool:
        return self.differences == 0


def _white(amplitude, num):
    return [amplitude] + [MP.mpf(0)] * (num - 1)


def _ar1(phi, sigma2, num):
    return list(accumulate(repeat(phi, num - 1), MP.fmul, initial=sigma2 / (1 - phi**2)))


def _ar1_closed_form(phi, sigma2, tau):
    """Guerrier et al. (2013), table 1, rearranged; loses all digits in double precision as phi -> 1."""
    n, d = tau // 2, 1 - phi
    e = 1 - phi**n
    return sigma2 / (1 - phi**2) * (n * d * (1 + phi) - phi * e * (2 + e)) / (2 * n**2 * d**2)


def _ar1_psd(phi, sigma2, f):
    return sigma2 / abs(1 - phi * MP.expjpi(-2 * f)) ** 2


def _gm(law):
    """A law of GM(beta, variance) from that of AR1(phi, sigma2)."""
    return lambda beta, variance, x: law(MP.exp(-beta), -variance * MP.expm1(-2 * beta), x)


def _lag_sum(phi, m, k):
    """sum_{h=1}^{m-1} (m - h) h^k phi^h, by applying phi d/dphi k times to its closed form for k = 0.

    Terms c phi^p/(1 - phi)^q, of which phi d/dphi makes c p phi^p/(1 - phi)^q + c q phi^(p+1)/(1 - phi)^(q+1).
    """
    terms = [(m, 1, 1), (-1, 1, 2), (1, m + 1, 2)]
    for _ in range(k):
        terms = [(c * p, p, q) for c, p, q in terms] + [(c * q, p + 1, q + 1) for c, p, q in terms]
    return sum(c * phi**p / (1 - phi) ** q for c, p, q in terms)


def _matern(*polynomial):
    """Laws for the autocovariance sum_k c_k (beta h)^k exp(-beta h): three functions of (beta, variance, x)."""

    def autocovariance(beta, variance, num):
        gamma = []
        for h in range(num):
            x = beta * h
            gamma.append(variance * MP.exp(-x) * sum(x**k * a / b for k, (a, b) in enumerate(polynomial)))
        return gamma

    def closed_form(beta, variance, tau):
        with MP.workdps(250):  # it cancels as beta^5
            phi, n = MP.exp(-beta), tau // 2

            def variance_of_sum(m):
                sums = (MP.mpf(a) / b * beta**k * _lag_sum(phi, m, k) for k, (a, b) in enumerate(polynomial))
                return m + 2 * sum(sums)

            return variance * (4 * variance_of_sum(n) - variance_of_sum(2 * n)) / (4 * MP.mpf(n) ** 2)

    def psd(beta, variance, f):
        with MP.workdps(250):
            z = MP.exp(-beta) * MP.expjpi(-2 * f)
            sums = (z / (1 - z), z / (1 - z) ** 2, z * (1 + z) / (1 - z) ** 3)  # of h^k z^h
            one_sided = sum(
                MP.mpf(a) / b * beta**k * s for k, ((a, b), s) in enumerate(zip(polynomial, sums, strict=False))
            )
            return variance * (1 + 2 * one_sided.real)

    return {"closed_form": closed_form, "autocovariance": autocovariance, "psd": psd}


def _fgn(H, sigma2, num):
    """Mandelbrot & Van Ness (1968): the second difference of the variance |m|^(2H) of the integrated noise."""
    power = [MP.mpf(m) ** (2 * H) if m else MP.mpf(0) for m in range(num + 1)]
    return [sigma2 * (power[abs(h - 1)] - 2 * power[h] + power[h + 1]) / 2 for h in range(num)]


def _aliased(h, alpha, f):
    """sum_k h |f+k|^-alpha sinc(f+k)^2."""
    s = alpha + 2
    return h * (MP.sinpi(f) / MP.pi) ** 2 * (MP.zeta(s, f) + MP.zeta(s, 1 - f))


def _fgn_psd(H, sigma2, f):
    return _aliased(sigma2 * MP.sinpi(H) * MP.gamma(2 * H + 1) * (2 * MP.pi) ** (1 - 2 * H), 2 * H - 1, f)


def _flicker_steps(B, num):
    """Of x_t - x_{t-1}: the fourth difference of the generalised covariance B^2/(2 pi) m^2 log|m|."""
    K = [B**2 / (2 * MP.pi) * m**2 * MP.log(m) if m else MP.mpf(0) for m in range(num + 2)]
    return [K[h + 2] + K[abs(h - 2)] - 4 * (K[h + 1] + K[abs(h - 1)]) + 6 * K[h] for h in range(num)]


def _band_flicker_steps(f0, B, num):
    """The same for K = (B^2/pi) int_0^f0 [cos(2 pi f m) - 1 + (2 pi f m)^2/2]/(2 pi f)^2 df/f."""

    def K(m):
        if m == 0:
            return MP.mpf(0)
        X = 2 * MP.pi * f0 * m
        bracket = (
            (MP.euler + MP.log(X) - MP.ci(X)) / 2 - MP.mpf(3) / 4 + MP.sin(X) / (2 * X) + (1 - MP.cos(X)) / (2 * X**2)
        )
        return B**2 / MP.pi * m**2 * bracket

    K = [K(m) for m in range(num + 2)]
    return [K[h + 2] + K[abs(h - 2)] - 4 * (K[h + 1] + K[abs(h - 1)]) + 6 * K[h] for h in range(num)]


def _band_flicker_closed_form(f0, B, tau):
    """IEEE Std 952-1997, eq. C.10, halved."""
    x = MP.pi * f0 * tau / 2
    sine, cosine = MP.sin(x), MP.cos(x)
    bracket = MP.log(2) - sine**3 / (2 * x**2) * (sine + 4 * x * cosine) + MP.ci(2 * x) - MP.ci(4 * x)
    return B**2 / MP.pi * bracket


def _band_flicker_psd(f0, B, f):
    aliases = [f + k for k in range(int(f0) + 1)] + [1 - f + k for k in range(int(f0) + 1)]
    total = sum((1 / a**3 for a in aliases if a <= f0), start=MP.mpf(0))
    return B**2 / (2 * MP.pi) * (MP.sinpi(f) / MP.pi) ** 2 * total


def _arma(p, q):
    """Laws of ARMA(p, q): functions of (phi_1 .. phi_p, theta_1 .. theta_q, sigma2, x)."""

    def gammas(values, num):
        """From the Yule-Walker equations gamma_k - sum_i phi_i gamma_{k-i} = sigma2 sum_{j>=k} theta_j psi_{j-k}."""
        phi, theta, sigma2 = values[:p], [MP.mpf(1), *values[p : p + q]], values[-1]
        psi = []
        for j in range(q + 1):
            psi.append(theta[j] + sum(phi[i - 1] * psi[j - i] for i in range(1, min(j, p) + 1)))
        right = [sigma2 * sum(theta[j] * psi[j - k] for j in range(k, q + 1)) for k in range(max(p, q) + 1)]
        A = MP.zeros(len(right))
        for k in range(len(right)):
            A[k, k] += 1
            for i in range(1, p + 1):
                A[k, abs(k - i)] -= phi[i - 1]
        gamma = list(MP.lu_solve(A, MP.matrix(right)))
        while len(gamma) < num:
            gamma.append(sum((phi[i - 1] * gamma[-i] for i in range(1, p + 1)), start=MP.mpf(0)))
        return gamma[:num]

    def closed_form(*arguments):
        """gamma_h = sum_i c_i lambda_i^h over the roots from some lag on, and the sums of powers in closed form."""
        *values, tau = arguments
        first, n = max(0, q - p + 1), tau // 2
        gamma = gammas(values, first + p + 1)
        polynomial = [*(-a for a in reversed(values[:p])), MP.mpf(1)]
        roots = MP.polyroots(polynomial, maxsteps=500, extraprec=500, asc=True) if p else []
        powers = MP.matrix([[x ** (first + k) for x in roots] for k in range(p)]) if p else None
        c = list(MP.lu_solve(powers, MP.matrix(gamma[first : first + p]))) if p else []

        def variance_of_sum(m):
            total = m * gamma[0] + 2 * sum((m - h) * gamma[h] for h in range(1, min(first, m)))
            for x, factor in zip(roots, c, strict=True):
                total += 2 * MP.re(factor * (_lag_sum(x, m, 0) - sum((m - h) * x**h for h in range(1, first))))
            return total

        return (4 * variance_of_sum(n) - variance_of_sum(2 * n)) / (4 * MP.mpf(n) ** 2)

    def psd(*arguments):
        *values, f = arguments
        z = MP.expjpi(-2 * f)
        above = 1 + sum((t * z**j for j, t in enumerate(values[p : p + q], start=1)), start=MP.mpf(0))
        below = 1 - sum((a * z**i for i, a in enumerate(values[:p], start=1)), start=MP.mpf(0))
        return values[-1] * abs(above / below) ** 2

    return {
        "closed_form": closed_form,
        "autocovariance": lambda *arguments: gammas(arguments[:-1], arguments[-1]),
        "psd": psd,
    }


_BETAS = (1e-12, 1e-9, 1e-6, 1e-4, 1.688923e-3, 1e-2, 0.1, 0.3, 0.7, 1.0, 2.0, 5.0, 20.0, 50.0)
_PHIS = (
    -0.999999, -0.9, -0.5, -1e-8, 0.0, 1e-8, 0.1269, 0.499, 0.501, 0.9, 0.9983125, 0.999999, 1 - 1e-9, 1 - 1e-12,
)  # fmt: skip

CASES = (
    Case(
        WN,
        parameters=((1.0,), (4.926494e-5,), (3e-20,)),
        outside=((-1.0,), (np.nan,), (np.inf,)),
        closed_form=lambda sigma2, tau: sigma2 / tau,
        autocovariance=_white,
        psd=lambda sigma2, f: sigma2,
    ),
    Case(
        QN,
        parameters=((1.0,), (3.2,), (1e-7,)),
        outside=((-1.0,), (np.nan,), (np.inf,)),
        closed_form=lambda q2, tau: 6 * q2 / MP.mpf(tau) ** 2,
        # sqrt(12 q2) (Y_t - Y_{t-1}) with Var Y = 1/12
        autocovariance=lambda q2, num: ([2 * q2, -q2] + [MP.mpf(0)] * num)[:num],
        psd=lambda q2, f: q2 * abs(1 - MP.expjpi(-2 * f)) ** 2,
        gaussian=False,
    ),
    Case(
        RW,
        parameters=((1.0,), (4.75507e-13,), (2.5,)),
        outside=((-1.0,), (np.nan,), (np.inf,)),
        closed_form=lambda gamma2, tau: gamma2 * (MP.mpf(tau) ** 2 + 2) / (12 * tau),
        autocovariance=_white,
        psd=lambda gamma2, f: gamma2 / abs(1 - MP.expjpi(-2 * f)) ** 2,
        differences=1,
    ),
    Case(
        DR,
        parameters=((1.0,), (3e-10,), (0.002,)),
        outside=((-1.0,), (np.nan,), (np.inf,)),
        closed_form=lambda omega, tau: omega**2 * MP.mpf(tau) ** 2 / 16,
        autocovariance=lambda omega, num: [MP.mpf(0)] * num,
        psd=None,
        differences=1,
        mean=lambda omega: omega,
    ),
    Case(
        AR1,
        parameters=tuple((phi, 1.7) for phi in _PHIS),
        outside=((1.0, 1.0), (-1.0, 1.0), (1.5, 1.0), (-2.0, 1.0), (np.nan, 1.0), (0.5, -1.0), (0.5, np.nan)),
        closed_form=_ar1_closed_form,
        autocovariance=_ar1,
        psd=_ar1_psd,
        short_memory=lambda phi, sigma2: abs(phi) < 1 - 1e-4,
    ),
    Case(
        GM,
        parameters=tuple((beta, 0.6) for beta in _BETAS),
        outside=((0.0, 1.0), (-0.1, 1.0), (np.inf, 1.0), (np.nan, 1.0), (0.5, -1.0), (0.5, np.inf)),
        closed_form=_gm(_ar1_closed_form),
        autocovariance=_gm(_ar1),
        psd=_gm(_ar1_psd),
        short_memory=lambda beta, variance: beta >= 1e-4,
    ),
    *(
        Case(
            cls,
            parameters=tuple((beta, 0.6) for beta in (0.3, 1e-12, 1e-6, 1.688923e-3, 5.0, 50.0)),
            outside=((0.0, 1.0), (-0.1, 1.0), (np.inf, 1.0), (np.nan, 1.0), (0.5, -1.0), (0.5, np.inf)),
            **_matern(*polynomial),
            rtol=1e-12,
            short_memory=lambda beta, variance: beta >= 2e-4,
        )
        for cls, polynomial in ((MAT32, ((1, 1), (1, 1))), (MAT52, ((1, 1), (1, 1), (1, 3))))
    ),
    Case(
        AR(2),
        # real roots of both signs, complex ones, a slow oscillation, 0.999 and 0.5, 1 - 1e-6 and 0.5
        parameters=(
            (0.5, 0.2, 1.7),
            (1.5, -0.8, 1.0),
            (-0.6, 0.3, 1.0),
            (1.93, -0.9409, 1.0),
            (1.499, -0.4995, 1.0),
            (1.499999, -0.4999995, 1.0),
        ),
        outside=((np.nan, 0.1, 1.0), (2.1, 0.1, 1.0), (0.1, 1.0, 1.0), (0.5, 0.2, -1.0), (0.5, 0.2, np.inf)),
        **_arma(2, 0),
        rtol=1e-10,
        second_derivatives_rtol=1e-8,  # of 1/delta at delta = 1 - phi1 - phi2 = 5e-7, which doubles know to 1e-10
        short_memory=lambda phi_1, phi_2, sigma2: phi_1 != 1.499999,
    ),
    Case(
        MA(1),
        parameters=((0.5, 1.3), (-0.9, 1.0), (0.0, 1.0), (-0.999999, 2.0)),
        outside=((np.nan, 1.0), (1.0, 1.0), (-1.5, 1.0), (0.5, -1.0), (0.5, np.inf)),
        **_arma(0, 1),
    ),
    Case(
        ARMA(2, 1),
        parameters=((1.5, -0.8, 0.4, 1.0), (0.5, 0.2, -0.6, 2.0), (1.89, -0.891, -0.5, 1.0)),
        outside=((0.5, 0.2, 1.5, 1.0), (np.nan, 0.2, 0.3, 1.0), (0.5, 0.2, 0.3, -1.0)),
        **_arma(2, 1),
        rtol=1e-12,
    ),
    Case(
        FGN,
        parameters=tuple((H, 1.3) for H in (0.3, 0.001, 0.5, 0.5 + 1e-8, 0.75, 0.8999, 0.9001, 0.99, 0.999999)),
        outside=((0.0, 1.0), (1.0, 1.0), (-0.1, 1.0), (np.nan, 1.0), (0.5, -1.0), (0.5, np.inf)),
        closed_form=lambda H, sigma2, tau: sigma2 * MP.mpf(tau // 2) ** (2 * H - 2) * (1 - MP.mpf(4) ** (H - 1)),
        autocovariance=_fgn,
        psd=_fgn_psd,
        short_memory=lambda H, sigma2: False,
    ),
    Case(
        BI,
        parameters=((1.0,), (3e-6,), (0.2,)),
        outside=((-1.0,), (np.nan,), (np.inf,)),
        closed_form=lambda B, tau: B**2 * MP.log(2) / MP.pi,
        autocovariance=_flicker_steps,
        psd=lambda B, f: _aliased(B**2 / (2 * MP.pi), 1, f),
        differences=1,
        short_memory=lambda B: False,
    ),
    Case(
        FLK,
        parameters=((0.1, 1.0), (1e-4, 2.0), (0.013, 0.3), (0.45, 1.0), (1.7, 1.0), (40.0, 1.0)),
        outside=((0.0, 1.0), (-0.1, 1.0), (np.nan, 1.0), (0.5, -1.0), (0.5, np.inf)),
        closed_form=_band_flicker_closed_form,
        autocovariance=_band_flicker_steps,
        psd=_band_flicker_psd,
        differences=1,
        rtol=1e-12,
        covariance_rtol=1e-7,  # the edge of its band rings for ever, though ever less
        short_memory=lambda f0, B: False,
    ),
    Case(
        SIN,
        parameters=((0.3, 1.3), (1e-6, 2.0), (1.7e-3, 0.5), (1.1, 1.0), (2.9, 1.0)),
        outside=((0.0, 1.0), (3.15, 1.0), (-0.1, 1.0), (np.nan, 1.0), (0.5, -1.0), (0.5, np.inf)),
        closed_form=lambda beta, alpha2, tau: (
            alpha2 * MP.sin(beta * tau / 4) ** 4 / (2 * MP.mpf(tau // 2) ** 2 * MP.sin(beta / 2) ** 2)
        ),
        autocovariance=lambda beta, alpha2, num: [alpha2 / 2 * MP.cos(beta * h) for h in range(num)],
        psd=None,
        gaussian=False,
        rtol=1e-11,  # where a span holds almost whole periods
    ),
)

# -- the table, for pytest.mark.parametrize --------------------------------------------------------------------------


SUMS = [
    WN(1.0) + GM(0.01, 0.5),
    WN(4.9e-5) + RW(4.8e-13) + GM(1.7e-3, 1.2e-7) + GM(8.8e-5, 1.2e-7),
    QN(1.0) + WN(0.1) + RW(1e-4),
    WN(1.0) + AR1(-0.7, 2.0) + AR1(0.99, 0.01),
    WN(1.0) + DR(0.01),
    RW(0.01) + DR(0.1) + GM(0.3, 1.0),
    WN(1.0) + QN(2.0) + RW(1e-3) + DR(1e-2) + GM(0.5, 1.0) + GM(1e-3, 2.0),
]
"""Models of several processes."""


def rows(**only: Any) -> list[Any]:
    """The rows whose attributes equal `only`, for `parametrize("case", ...)`."""
    return [pytest.param(c, id=c.cls.kind) for c in CASES if all(getattr(c, k) == v for k, v in only.items())]


def derivative_rows(**only: Any) -> list[Any]:
    """As `rows`, without what takes minutes: MAT52, which is MAT32 once more differentiated; ARMA of higher orders."""
    return [row for row in rows(**only) if row.id not in ("MAT52", "ARMA(2,1)")]


def row_of(kind: str) -> Case:
    return next(c for c in CASES if c.cls.kind == kind)


# -- what follows from a row -----------------------------------------------------------------------------------------


def exact(values: tuple[float, ...]) -> list[Any]:
    """The doubles, exactly, in mpmath."""
    return [MP.mpf(v) for v in values]


def haar_filter(tau: int, differences: int = 0) -> Any:
    """tau times the Haar filter of span tau, newest sample first, or the filter with the same output for differences.

    A filter whose sum is zero is applied to x as its running sum to x_t - x_{t-1}.
    """
    h = np.repeat([1, -1], tau // 2)
    for _ in range(differences):
        h = np.cumsum(h)
    return h


_AUTOCOVARIANCES: dict[Any, list[Any]] = {}


def exact_autocovariance(case: Case, values: tuple[float, ...], num: int) -> list[Any]:
    """The autocovariance that the row defines, at num lags; the longest asked for so far is kept."""
    known = _AUTOCOVARIANCES.get((case.cls, values), [])
    if len(known) < num:
        known = _AUTOCOVARIANCES[case.cls, values] = case.autocovariance(*exact(values), num)
    return known[:num]


def defined_wavelet_variance(case: Case, values: tuple[float, ...], taus: list[int]) -> list[Any]:
    """E(W_t^2) from the definition: filter' covariance filter, summed over lags with the filters in integers."""
    gamma = exact_autocovariance(case, values, max(taus))
    mean = case.mean(*exact(values))
    result = []
    for tau in taus:
        g = haar_filter(tau, case.differences)
        overlap = [int(a) for a in np.correlate(g, g, "full")[tau - 1 :]]
        variance = 2 * MP.fdot(zip(overlap, gamma, strict=False)) - overlap[0] * gamma[0]
        result.append((variance + (int(g.sum()) * mean) ** 2) / MP.mpf(tau) ** 2)
    return result


def closed_wavelet_variance(case: Case, values: tuple[float, ...], taus: list[int]) -> list[Any]:
    """The textbook formula at 80 digits."""
    return [case.closed_form(*exact(values), tau) for tau in taus]


def sample_covariance(case: Case, values: tuple[float, ...], num: int, *, less_variance: bool = False) -> Any:
    """Cov(x_s, x_t), s, t = 1..num, in double precision.

    With `less_variance` the constant gamma(0) is taken off, in 80 digits: filters that sum to zero do not see it,
    and what is left of a slow process has all its digits.
    """
    gamma = exact_autocovariance(case, values, num)
    if less_variance and case.stationary:
        gamma = [g - gamma[0] for g in gamma]
    covariance = scipy.linalg.toeplitz(np.array([float(g) for g in gamma]))
    for _ in range(case.differences):
        covariance = np.cumsum(np.cumsum(covariance, axis=0), axis=1)
    return covariance


def sample_mean(case: Case, values: tuple[float, ...], num: int) -> Any:
    """E(x_t), t = 1..num."""
    mean = np.full(num, float(case.mean(*exact(values))))
    for _ in range(case.differences):
        mean = np.cumsum(mean)
    return mean
