"""The command line ``gmwm-jax`` and its demonstration."""
