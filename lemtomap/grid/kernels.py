"""Jitted functions of the rolling window on plain arrays."""
