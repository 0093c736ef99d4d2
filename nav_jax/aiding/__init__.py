"""Aiding sensors, one a file: what they measure, how well, when, and what they measured.

A new sensor is one file here, with a class that derives from `AbstractAiding` (barometer.py is the shortest example), one
row in the registry, and one row in the table of the tests. Monte Carlo, analysis, design, tuning and smoother take it from
there, its own states included: they join the error state.

```python
truth = nj.ImuErrors("WN(sigma2=6e-5)", "WN(sigma2=1.5e-6)", rate=50.0)
aid = [
    nj.GnssPosition(horizontal=0.02, vertical=0.04, lever_arm=(1.0, 0.0, -0.5), outages=[(20.0, 40.0)]),
    nj.Odometer(rate=10.0, speed=0.05, sideways=0.02, lever_arm=(-1.0, 0.0, 0.5), scale_sd=0.01),  # estimates its scale
]
scenario = nj.Scenario(nj.motions.racetrack(duration=40.0, rate=50.0, straight=10.0, turn=10.0), aid, every=5)
print(nj.error_budget(scenario, truth))
```
"""  # noqa: E501

from nav_jax.aiding.barometer import Barometer as Barometer
from nav_jax.aiding.base import AbstractAiding as AbstractAiding
from nav_jax.aiding.dual_antenna import DualAntenna as DualAntenna
from nav_jax.aiding.fixes import Fixes as Fixes
from nav_jax.aiding.gnss import Gnss as Gnss
from nav_jax.aiding.gnss import GnssPosition as GnssPosition
from nav_jax.aiding.gnss import GnssVelocity as GnssVelocity
from nav_jax.aiding.magnetometer import Magnetometer as Magnetometer
from nav_jax.aiding.non_holonomic import NonHolonomic as NonHolonomic
from nav_jax.aiding.odometer import Odometer as Odometer
from nav_jax.aiding.registry import AIDING as AIDING
from nav_jax.aiding.standstill import ZeroRate as ZeroRate
from nav_jax.aiding.standstill import ZeroVelocity as ZeroVelocity
from nav_jax.aiding.states import OwnState as OwnState
