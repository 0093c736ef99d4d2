"""Formats of loggers: one file and one row of `registry` each."""
