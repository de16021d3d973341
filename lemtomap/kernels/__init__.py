"""Flat loops over plain arrays that more than one layer needs."""
