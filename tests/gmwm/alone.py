"""Processes of the package by one of their laws: what follows from it numerically stands beside their own."""

from functools import cache

import numpy as np

import gmwm_jax as gj
from gmwm_jax.processes import OwnProcess

LAWS = ("unit_psd", "unit_autocovariance", "unit_wavelet_variance")
TAU = 2.0 ** np.arange(1, 25)


@cache
def alone(cls, law, *, stationary=True, ringing=0.0):
    """A process of the package by one of its laws."""

    def given(own, shape, x):
        return getattr(cls, law)(shape, x)

    body = {
        "__annotations__": {p.name: "jax.Array | None" for p in cls.parameters},
        "kind": f"{cls.__name__}_{law.split('_')[1]}".upper(),
        "parameters": cls.parameters,
        "stationary": stationary,
        "amplitude_of": staticmethod(cls.amplitude_of),
        "value_of": staticmethod(cls.value_of),
        "ringing": classmethod(lambda own, shape: ringing),
        law: classmethod(given),
    }
    return type(body["kind"].title(), (OwnProcess,), body)


def difference_of_covariances(own, process, num_samples=2**14):
    """Of the wavelet variance, in standard deviations of both."""
    V, W = (np.asarray(gj.variance.wv_covariance(p, num_samples)) for p in (own, process))
    sd = np.sqrt(np.diag(W))
    return np.max(np.abs(V - W) / np.outer(sd, sd))
