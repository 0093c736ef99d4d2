"""Known effects (a trend, a season, a step) estimated together with the dependent noise around them.

Known effects (a trend, a season, a step, temperature) are estimated together with the noise around them, gaps allowed:

```python
t = np.arange(4000.0)
noise = gj.simulate("WN(sigma2=1.0) + GM(beta=0.05, variance=1.0)", 4000, key=jax.random.key(2))
y = 1e-3 * t + np.where(t < 2500.0, 0.0, 5.0) + np.asarray(noise)
y[300:500] = np.nan
print(gj.regress(y, {**gj.regression.trend(t), **gj.regression.step(t, 2500.0)}, "WN + GM", rate=1.0))
```
"""

from gmwm_jax.regression.regression import Coefficient as Coefficient
from gmwm_jax.regression.regression import Coefficients as Coefficients
from gmwm_jax.regression.regression import Regression as Regression
from gmwm_jax.regression.regression import regress as regress
from gmwm_jax.regression.regressors import Regressor as Regressor
from gmwm_jax.regression.regressors import polynomial as polynomial
from gmwm_jax.regression.regressors import seasonal as seasonal
from gmwm_jax.regression.regressors import step as step
from gmwm_jax.regression.regressors import trend as trend
