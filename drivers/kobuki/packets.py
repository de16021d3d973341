"""Facts of the Kobuki protocol."""
