"""Planes through what the cells of a window averaged: the surface a scan is matched along."""
