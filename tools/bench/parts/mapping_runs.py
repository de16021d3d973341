"""One mapping run in a process of its own, so that CPU and memory are its own; kept for the next time."""

import json
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lemtomap.robot.child import python


@dataclass(frozen=True, slots=True)
class MappingRun:
    """What to run, and where its results stand."""

    log: Path
    slam: str
    particles: int
    seed: int
    out: Path

    def summary(self) -> dict[str, Any]:
        """Run `lemtomap map` unless it has been run here before; return its summary."""
        told = self.out / "summary.json"
        if not told.exists():
            options = ["--slam", self.slam, "--particles", str(self.particles), "--seed", str(self.seed)]
            command = python("-m", "lemtomap", "map", str(self.log), "--out", str(self.out), *options)
            print(f"  {self.out.name}", flush=True)
            subprocess.run(command, check=True)  # noqa: S603 - our own interpreter and module
        found: dict[str, Any] = json.loads(told.read_text())
        return found


def slam_cpu_s(summary: dict[str, Any]) -> float:
    """Return the CPU time of mapping alone: neither reading the log nor drawing."""
    return float(summary["cpu_by_part_s"]["grid"] + summary["cpu_by_part_s"]["topo"])


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
