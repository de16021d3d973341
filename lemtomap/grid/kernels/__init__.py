"""Flat loops over the arrays of a window, one noun a file."""
