"""Flat loops over the bytes of a log."""
