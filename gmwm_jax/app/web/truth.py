"""What a simulated record was drawn from, beside what is estimated from it."""

import math

from gmwm_jax.processes.base import AbstractProcess, Composite


def beside(model: Composite, truth: Composite) -> tuple[float, ...]:
    """Return the true value of each parameter of a model; NaN where it has none.

    A component that the truth does not have is truly zero. Of several of a kind the first are those with the shortest
    correlation time, as in a fit; where the truth has another number of them, none is that of another.

    Parameters
    ----------
    model
        That was fitted.
    truth
        All values given.

    Examples
    --------
    >>> from gmwm_jax.app.web import truth
    >>> drawn = gj.parse_model("GM(beta=0.01, variance=2.0) + WN(sigma2=1.0)")
    >>> truth.beside(gj.parse_model("WN + RW + GM"), drawn)
    (1.0, 0.0, 0.01, 2.0)
    """
    found: list[float] = []
    for position, p in enumerate(model.processes):
        own = sorted((q for q in truth.processes if type(q) is type(p)), key=_rate_of_decay, reverse=True)
        wanted = [k for k, q in enumerate(model.processes) if type(q) is type(p)]
        if len(own) == len(wanted):
            found += [float(v) for v in own[wanted.index(position)].values]
        else:
            none = not own and len(p.parameters) == 1
            found += [0.0 if none else math.nan] * len(p.parameters)
    return tuple(found)


def _rate_of_decay(process: AbstractProcess) -> float:
    """Of a Gauss-Markov process; the others keep their order."""
    named = dict(zip((q.name for q in process.parameters), process.values, strict=True))
    return float(named.get("beta", 0.0))
