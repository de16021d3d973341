"""Fine alignment of one set of hits with another."""
