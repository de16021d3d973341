"""SCIP frames: bytes in, events out."""
