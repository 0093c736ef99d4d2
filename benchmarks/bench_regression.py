"""Regression with dependent errors: trend, two harmonics of a season and a step in WN + RW noise.

The peer is generalised least squares with dense matrices in NumPy (Sigma of the same noise, its Cholesky factor, two
solutions), which takes O(N^3) time and O(N^2) memory; at N = 2000 only.
"""

import jax

jax.config.update("jax_enable_x64", True)
import numpy as np
from common import Report, compilations, interleaved, repeated, seconds, timed

import gmwm_jax as gj

SIGMA2, GAMMA2 = 1.0, 1e-4
MODEL = f"WN(sigma2={SIGMA2}) + RW(gamma2={GAMMA2})"
TRUTH = np.array([5.0, 1e-3, 2.0, -1.0, 0.5, 0.3, 3.0])


def record(
    num: int, missing: float, seed: int = 0
) -> tuple[np.ndarray, dict[str, gj.regression.Regressor], np.ndarray]:
    """A record at 1 Hz with missing samples, its regressors and their matrix."""
    rng = np.random.default_rng(seed)
    t = np.arange(num, dtype=float)
    regressors = {**gj.regression.trend(t), **gj.regression.seasonal(t, num / 4, 2), **gj.regression.step(t, num // 3)}
    X = np.column_stack([np.ones(num), *(c.values for c in regressors.values())])
    y = X @ TRUTH + np.sqrt(SIGMA2) * rng.standard_normal(num) + np.cumsum(np.sqrt(GAMMA2) * rng.standard_normal(num))
    y[rng.random(num) < missing] = np.nan
    return y, regressors, X


def dense(y: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and standard errors with dense matrices, the noise known."""
    present = ~np.isnan(y)
    t = np.flatnonzero(present) + 1.0
    L = np.linalg.cholesky(SIGMA2 * np.eye(len(t)) + GAMMA2 * np.minimum(t[:, None], t))
    W = np.linalg.solve(L, np.column_stack([y[present], X[present]]))
    C = np.linalg.inv(W[:, 1:].T @ W[:, 1:])
    return C @ W[:, 1:].T @ W[:, 0], np.sqrt(np.diag(C))


def main() -> None:
    report = Report("regression", __doc__)
    repeats = 2 if report.quick else 5
    sizes = (10**4,) if report.quick else (10**5, 10**6)

    rows = []
    for num in sizes:
        for missing in (0.0, 0.1):
            y, regressors, X = record(num, missing)
            with compilations() as compiled:
                first, result = timed(lambda y=y, r=regressors: gj.regress(y, r, "WN + RW", rate=1.0))
            run = repeated(lambda y=y, r=regressors: gj.regress(y, r, "WN + RW", rate=1.0), repeats)
            present = ~np.isnan(y)
            gls = repeated(lambda y=y, X=X, p=present: gj.processes.generalised_least_squares(MODEL, y, X, p), repeats)
            worst = np.max(np.abs(result.coefficients.estimates - TRUTH) / result.coefficients.standard_errors)
            rows.append(
                [
                    f"{num:.0e}",
                    f"{100 * missing:g} %",
                    seconds(compiled.seconds),
                    seconds(first),
                    run,
                    result.num_rounds,
                    gls,
                    f"{worst:.1f}",
                ]
            )
            if num == sizes[-1]:
                share = f", {100 * missing:g} % missing" if missing else ""
                report.bar(f"regression, N = {num:.0e}, 7 coefficients{share}", "", seconds(run.median))
    report.table(
        "`gj.regress`: noise fitted, 7 coefficients; and one least squares with known noise",
        ["N", "missing", "XLA compile", "first call", "warm, median (range)", "rounds", "one GLS", "worst error/SE"],
        rows,
    )

    num = 500 if report.quick else 2000
    y, _, X = record(num, 0.1)
    present = ~np.isnan(y)
    times = interleaved(
        {
            "state space": lambda: gj.processes.generalised_least_squares(MODEL, y, X, present),
            "dense": lambda: dense(y, X),
        },
        repeats,
    )
    gls, (b, errors) = gj.processes.generalised_least_squares(MODEL, y, X, present), dense(y, X)
    off = (
        np.max(np.abs(np.asarray(gls.estimates) / b - 1)),
        np.max(np.abs(np.sqrt(np.diag(gls.covariance)) / errors - 1)),
    )
    ours, peer = times["state space"], times["dense"]
    report.table(
        f"Generalised least squares with known noise, N = {num}, 10 % missing",
        ["", "median (range)"],
        [[name, t] for name, t in times.items()],
    )
    report.say(f"Largest relative difference: estimates {off[0]:.0e}, standard errors {off[1]:.0e}.")
    report.bar(
        f"GLS with known noise, N = {num}",
        "",
        seconds(ours.median),
        f"{seconds(peer.median)} dense NumPy",
        f"{ours.median / peer.median:.3f}",
    )
    report.save()


if __name__ == "__main__":
    main()
