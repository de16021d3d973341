"""Jitted functions of navigation on plain arrays."""
