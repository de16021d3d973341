"""Laser hits gathered in a ring of cells around the robot."""
