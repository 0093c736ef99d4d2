"""The robust wavelet variance as its definition has it, and as R's: for comparison only."""

import mpmath
import numpy as np
import scipy.optimize


def g(r, c):
    """The function of a coefficient over its standard deviation, of which the robust variance takes the mean."""
    return np.where(np.abs(r) <= c, r**2 * (1 - (r / c) ** 2) ** 4, 0.0)


def truncated_moment(k, c):
    """E(Z^k; |Z| <= c) = (k-1)!! P((k+1)/2, c^2/2)."""
    return mpmath.fac2(k - 1) * mpmath.gammainc((k + 1) / mpmath.mpf(2), 0, c * c / 2, regularized=True)


def efficiency_that_r_calls(nominal):
    """R has one sign of E g^2 the wrong way round (that of the moment 18), and with it another constant c."""

    def formula(c):
        def moment(k):
            return float(truncated_moment(k, mpmath.mpf(c)))

        a = sum((-1) ** i * float(mpmath.binomial(4, i)) * moment(2 + 2 * i) / c ** (2 * i) for i in range(5))
        m = sum((-1) ** i * float(mpmath.binomial(4, i)) * moment(4 + 2 * i) / c ** (2 * i) for i in range(5)) - a
        q = sum((-1) ** i * float(mpmath.binomial(8, i)) * moment(4 + 2 * i) / c ** (2 * i) for i in range(9)) - a * a
        return m * m / 2 / q, m * m / 2 / (q + 16 * moment(18) / c**14)

    c = scipy.optimize.brentq(lambda c: formula(c)[1] - nominal, 4.0, 8.0)
    return formula(c)[0]
