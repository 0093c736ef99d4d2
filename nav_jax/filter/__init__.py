"""The error-state Kalman filter: its layout, its one time loop, the smoother, and a prepared scenario.

What the filter is
------------------
It is a quaternion error-state extended Kalman filter, by default over a flat Earth that does not turn, with gravity as
given. Attitude errors are rotation vectors in n; updates go one scalar after the other in Joseph's form. The mechanisation
is exact for constant rate and specific force within a sample; the sensors' errors are held for a sample, in the emulation
and in the filter, so that the discretisation of the noise is exact too. Fixes may lie anywhere between samples.

| process | in the filter |
|---|---|
| `WN` | in the process noise |
| `RW`, `GM`, `AR1` | one state an axis |
| `AR`, `MA`, `ARMA` | max(p, q + 1) states an axis |
| `DR` | two states, value and slope; the slope is N(0, omega²), since its sign is unknown |
| turn-on bias | one state, constant |
| `MAT32`, `MAT52` | two and three states an axis |
| `SIN` | two states |
| `QN` | none: its integral is bounded by √(2 q2)/f, which the result states in a note |
| `BI`, `FLK`, `FGN` | none, which the result states in a note; `flicker_ladder` has states |

Inside JAX programs `prepare`, `draw_inputs` and `run_filter` are what `compare` is made of: pure functions, jitted,
vectorised over runs, to be differentiated in the parameters of truth, filter, aiding and initial covariance.

```python
short = nj.Scenario(nj.motions.lemniscate(duration=10.0, rate=100.0), [nj.Barometer(height=0.5)])
experiment = nj.filter.prepare(short, rate=100.0)
keys = nj.filter.run_keys(jax.random.key(0), 0, 4)
imu = nj.ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", rate=100.0)


def cost(believed):  # mean squared position error at the end, as a function of what the filter believes
    outcome = nj.filter.run_filter(experiment, believed, nj.filter.draw_inputs(experiment, imu, keys))
    return (outcome.judgement.error[-1, :3] ** 2).sum(axis=0).mean()


slope = jax.jacfwd(lambda sigma2: cost(nj.ImuErrors(gj.WN(6e-5), gj.WN(sigma2), rate=100.0)))(1.5e-6)
```
"""  # noqa: E501

from nav_jax.filter.experiment import Experiment as Experiment
from nav_jax.filter.experiment import draw_inputs as draw_inputs
from nav_jax.filter.experiment import gains_of as gains_of
from nav_jax.filter.experiment import prepare as prepare
from nav_jax.filter.experiment import run_filter as run_filter
from nav_jax.filter.experiment import run_keys as run_keys
from nav_jax.filter.history import Estimates as Estimates
from nav_jax.filter.initial import InitialUncertainty as InitialUncertainty
from nav_jax.filter.initial import LinearisationWarning as LinearisationWarning
from nav_jax.filter.scenario import Scenario as Scenario
from nav_jax.filter.status import Status as Status
