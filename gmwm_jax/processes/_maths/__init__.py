"""Recursions, series and quadratures that several processes need."""
