"""Localisation data: what a place looks like to the laser, in a couple of hundred bytes."""

from lemtomap.topo.place.codec import Boundary, decode_place, encode_place

__all__ = ["Boundary", "decode_place", "encode_place"]
