"""The latent processes, one a file, and their sums.

Each knows its theory (wavelet variance, spectrum, autocovariance, covariance of Haar coefficients), its text, how to
draw it, its state space and its continuous-time form. Parameters are per sample.

Models are sums of processes, as text or as objects. Values start a search, ``fixed`` ones are held, and a model whose
values are all given has theory and can be simulated:

```python
model = gj.parse_model("WN + GM(beta=0.01 fixed)")
model = gj.WN() + gj.GM(beta=gj.Fixed(0.01))  # the same model
model = gj.WN(sigma2=1.0) + gj.GM(beta=0.01, variance=2.0)
x = gj.simulate(model, 1000, key=jax.random.key(0))
nu = model.wavelet_variance([2.0, 4.0, 8.0])  # differentiable, like psd() and autocovariance()
promised, signal = gj.from_datasheet({"N": "0.05 deg/s/sqrt(Hz)"}, rate=100.0)
```

The processes
-------------
u is the unit of the signal (rad/s or m/s²), f the sampling rate. Parameters are per sample; the other forms are computed
from them at a rate that is stated.

| | process | per sample | Kalman filter, SI | datasheet (gyro; accelerometer) |
|---|---|---|---|---|
| `WN` | white noise | `sigma2` [u²] | q = sigma2/f [u²/Hz] | N = √q: deg/√h; µg/√Hz |
| `QN` | quantisation | `q2` [u²] | Q = √q2/f [u s] | Q, LSB = √12 Q: arcsec; m/s |
| `RW` | random walk | `gamma2` [u²] | q = gamma2 f [u²/s] | K = √q: deg/h/√h; m/s/h/√h |
| `DR` | drift | `omega` [u] | R = omega f [u/s] | R: deg/h/h; µg/h |
| `GM` | Gauss-Markov | `beta` [1], `variance` [u²] | beta f [1/s], q = 2 beta f variance [u²/s] | sigma: deg/h; µg, tau_c = 1/(beta f), √q, N_0 = √(psd(0)/f) |
| `AR1` | the same | `phi`, `sigma2` [u²] | as GM, with beta = -ln phi | as GM |
| `AR(p)`, `MA(q)`, `ARMA(p,q)` | autoregressive moving average, as R and statsmodels write it | `phi1` .., `theta1` .. [1], `sigma2` [u²] | PSD at 0 [u²/Hz]; the rest belongs to its rate | sigma, N_0 |
| `MAT32` | second-order Gauss-Markov (Matérn 3/2) | `beta` [1], `variance` [u²] | beta f [1/s], q of the driving noise | sigma: deg/h; µg |
| `MAT52` | third-order Gauss-Markov (Matérn 5/2) | `beta` [1], `variance` [u²] | beta f [1/s], q of the driving noise | sigma: deg/h; µg |
| `BI` | bias instability: flicker noise without cutoff | `B` [u] | B [u] | B, floor = 0.664 B: deg/h; µg |
| `FLK` | bias instability as IEEE 952 has it, flicker noise up to the corner f0 | `f0` [1], `B` [u] | f0 f [Hz], B [u] | B: deg/h; µg |
| `FGN` | fractional Gaussian noise | `H` [1], `sigma2` [u²] | H, PSD at 1 Hz | H, density at 1 Hz |
| `SIN` | sinusoid of unknown phase | `beta` [1], `alpha2` [u²] | omega [rad/s], alpha2 [u²] | frequency: Hz; amplitude: deg/h, µg |

A model holds at most one each of WN, QN, RW, DR, BI, FLK and FGN, and any number of the others (GM or AR1, not both):
``"WN + RW + 3*GM"``, ``"WN + ARMA(2,1)"``, ``gj.WN() + gj.AR(2)()``. ``MA(q)``, and ``ARMA(p,q)`` with q ≥ p, contain white
noise and take no ``WN`` beside them.

N_0 of a Gauss-Markov process is its density as white noise over times much longer than its correlation time: what the
-1/2 slope of an Allan plot shows. With a correlation time near one sample it is larger than √q/(beta f).

A process of your own
---------------------
It needs a class that derives from `OwnProcess`, names its parameters (the last one carries the amplitude) and defines one
law for unit amplitude: the PSD, the autocovariance, or the wavelet variance. All others follow numerically, to the accuracy
that `OwnProcess` states, and with them fits, standard errors, selection and simulation. `register` gives it a text form,
by which files know it as well; without it the object serves. Here noise that is flat up to a corner and falls as a power
of frequency beyond it:

>>> @gj.processes.register
... class Knee(gj.processes.OwnProcess):
...     fc: jax.Array | None
...     a: jax.Array | None
...     c: jax.Array | None
...     kind = "KNEE"
...     parameters = (
...         gj.processes.Parameter("fc", "1/sample", "corner frequency"),
...         gj.processes.Parameter("a", "1", "exponent", lower=0.5, upper=1.5),
...         gj.processes.Parameter("c", "({u})^2", "PSD at 0"),
...     )
...     @classmethod
...     def unit_psd(cls, shape, frequency):
...         fc, a = shape
...         return 1 / (1 + (frequency / fc) ** a)
>>> truth = gj.WN(sigma2=1e-6) + Knee(fc=2e-3, a=1.3, c=1e-4)
>>> x = gj.simulate(truth, 100_000, key=jax.random.key(7))
>>> fit = gj.fit(gj.wavelet_variance(np.asarray(x)), "WN + KNEE")
>>> fit.model.labels
('WN', 'KNEE')
>>> bool(abs(fit.model.processes[1].a - 1.3) < 0.1)
True

Whatever else the class defines replaces what would follow: ``continuous`` gives it rows in the tables of filters and
datasheets and lets it move to another rate, ``state_space`` lets a Kalman filter hold it (a power of frequency, for example,
by a sum of Gauss-Markov processes). A filter without ``state_space`` leaves the process out, and an analysis of covariances
refuses it.

A process for the package is one file here, with a class that derives from `AbstractProcess` and has all laws in closed form
(white_noise.py is the shortest example), one row in ``registry.py``, and one row in the table of the tests, by which all
tests of theory, simulation, covariance and units run on it.
"""  # noqa: E501

from gmwm_jax.processes.arma import AR as AR
from gmwm_jax.processes.arma import ARMA as ARMA
from gmwm_jax.processes.arma import MA as MA
from gmwm_jax.processes.band_flicker import FLK as FLK
from gmwm_jax.processes.base import AbstractProcess as AbstractProcess
from gmwm_jax.processes.base import Composite as Composite
from gmwm_jax.processes.continuous import from_continuous as from_continuous
from gmwm_jax.processes.continuous import to_continuous as to_continuous
from gmwm_jax.processes.datasheet import from_datasheet as from_datasheet
from gmwm_jax.processes.drift import DR as DR
from gmwm_jax.processes.flicker import BI as BI
from gmwm_jax.processes.flicker import flicker_ladder as flicker_ladder
from gmwm_jax.processes.fractional import FGN as FGN
from gmwm_jax.processes.gauss_markov import AR1 as AR1
from gmwm_jax.processes.gauss_markov import GM as GM
from gmwm_jax.processes.matern import MAT32 as MAT32
from gmwm_jax.processes.matern import MAT52 as MAT52
from gmwm_jax.processes.own import OwnProcess as OwnProcess
from gmwm_jax.processes.parameter import Fixed as Fixed
from gmwm_jax.processes.parameter import Limit as Limit
from gmwm_jax.processes.parameter import Parameter as Parameter
from gmwm_jax.processes.quantisation import QN as QN
from gmwm_jax.processes.random_walk import RW as RW
from gmwm_jax.processes.registry import parse_model as parse_model
from gmwm_jax.processes.registry import register as register
from gmwm_jax.processes.simulation import simulate as simulate
from gmwm_jax.processes.sinusoid import SIN as SIN
from gmwm_jax.processes.state_space import StateSpace as StateSpace
from gmwm_jax.processes.white_noise import WN as WN
from gmwm_jax.processes.whitening import GeneralisedLeastSquares as GeneralisedLeastSquares
from gmwm_jax.processes.whitening import Whitened as Whitened
from gmwm_jax.processes.whitening import covariance_times as covariance_times
from gmwm_jax.processes.whitening import generalised_least_squares as generalised_least_squares
from gmwm_jax.processes.whitening import whiten as whiten
