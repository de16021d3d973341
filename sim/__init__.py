"""A pybullet world and the device side of both serial protocols, written without `drivers/`.

Ground truth lives here and in tests only. Nothing of ours is imported, so that a codec bug cannot cancel
itself out.
"""
