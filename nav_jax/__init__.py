"""What the noise model of an inertial sensor does to navigation: strapdown INS/GNSS/baro Monte Carlo in JAX.

The package is built on the noise models of `gmwm_jax` and starts with the release after this one.
"""
