"""gmwm_jax."""
