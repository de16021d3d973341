"""Resident memory of this process, without what the allocator merely keeps for later."""

import ctypes
import gc
import os
from pathlib import Path

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


def private_mb() -> float:
    """Return what is this process' own: no libraries or files shared with others, MB (10^6 bytes)."""
    _trim()
    rows = Path("/proc/self/smaps_rollup")
    if not rows.exists() or os.name != "posix":
        return float(psutil.Process().memory_info().rss) / 1e6
    kib = [int(line.split()[1]) for line in rows.read_text().splitlines() if line.startswith("Private_")]
    return sum(kib) * 1024 / 1e6
