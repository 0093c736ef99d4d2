"""Configuration files, the command line ``nav-jax``, reports and the demonstration."""
