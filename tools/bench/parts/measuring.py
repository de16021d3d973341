"""Resident memory of this process, without what the allocator merely keeps for later."""

import ctypes
import gc

import psutil


def _trim() -> None:
    """Give free heap back to the system where the C library can."""
    gc.collect()
    if hasattr(ctypes.CDLL(None), "malloc_trim"):
        ctypes.CDLL(None).malloc_trim(0)


def resident_mb() -> float:
    """Return what this process holds now, MB (10^6 bytes), free heap given back first."""
    _trim()
    return float(psutil.Process().memory_info().rss) / 1e6
