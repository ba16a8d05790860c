"""Estimates from sensor readings."""
