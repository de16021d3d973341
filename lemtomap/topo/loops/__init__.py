"""Recognising places: explicit topological loop closing (thesis, sections 3-3-2 and 7-2)."""

from lemtomap.topo.loops.config import LoopConfig
from lemtomap.topo.loops.recogniser import LoopRecogniser

__all__ = ["LoopConfig", "LoopRecogniser"]
