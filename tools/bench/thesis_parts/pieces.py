"""Finished pieces of a long piece of work, each a JSON file: stop with Ctrl-C, run again, and it goes on."""

import json
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class Piece:
    """One piece of work by its name; `work` may take minutes."""

    name: str
    work: Callable[[], dict[str, Any]]


class Pieces:
    """A folder of finished pieces."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._begun_s = time.perf_counter()
        self._done = self._all = 0

    def run(self, pieces: Sequence[Piece], jobs: int) -> None:
        """Do what is not done yet, `jobs` at a time, in the given order."""
        todo = [piece for piece in pieces if not self._path(piece.name).exists()]
        self._done, self._all = len(pieces) - len(todo), len(pieces)
        if self._done:
            print(f"{self._done} of {self._all} pieces were done before", flush=True)
        with ThreadPoolExecutor(jobs) as pool:
            futures = [pool.submit(self._do, piece) for piece in todo]
            try:
                wait(futures)  # one that fails keeps no other from being done
            finally:
                for future in futures:
                    future.cancel()
            for future in futures:
                if not future.cancelled():
                    future.result()

    def told(self, name: str) -> dict[str, Any]:
        """Return what a finished piece told."""
        found: dict[str, Any] = json.loads(self._path(name).read_text())
        return found

    def _do(self, piece: Piece) -> None:
        begun_s = time.perf_counter()
        result = piece.work()
        partial = self._path(piece.name).with_suffix(".part")
        partial.write_text(json.dumps(result))
        partial.rename(self._path(piece.name))
        self._done += 1
        now_s = time.perf_counter()
        print(
            f"[{self._done}/{self._all}] {piece.name}: {now_s - begun_s:.0f} s, "
            f"{(now_s - self._begun_s) / 60:.1f} min in all",
            file=sys.stderr,
            flush=True,
        )

    def _path(self, name: str) -> Path:
        return self._folder / f"{name}.json"
