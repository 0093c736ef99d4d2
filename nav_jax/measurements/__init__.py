"""Aiding sensors, one a file: what they measure, how well, and when."""
