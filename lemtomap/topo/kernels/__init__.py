"""Flat loops of the topological map over plain arrays, one noun a file."""
