"""Doors and areas (thesis, sections 3-3-1, 3-3-2, 3-5): which nodes make a room, and what leads into it."""
