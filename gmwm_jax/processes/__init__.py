"""The latent processes, one a file, and their sums."""
