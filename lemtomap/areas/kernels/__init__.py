"""Flat loops of door and area detection over plain arrays, one noun a file."""
