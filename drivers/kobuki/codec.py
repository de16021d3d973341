"""Kobuki frames: bytes in, events out."""
