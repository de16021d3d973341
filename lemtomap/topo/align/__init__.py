"""The local grid map transform: where a known place stands in the window, by matching."""

from lemtomap.topo.align.hits import HitMap
from lemtomap.topo.align.match import Match, MatchConfig, match_place

__all__ = ["HitMap", "Match", "MatchConfig", "match_place"]
