"""What is odd in a log and does no harm to the rest of it: one line for each kind."""

from dataclasses import dataclass


@dataclass(slots=True)
class _Kind:
    first: int
    detail: str
    times: int = 0


class Remarks:
    """Oddities, counted by kind; the first place of each is kept."""

    def __init__(self) -> None:
        self._kinds: dict[str, _Kind] = {}

    def add(self, kind: str, place: int, detail: str) -> None:
        """Count one more of a kind, seen in a line."""
        known = self._kinds.setdefault(kind, _Kind(place, detail))
        known.times += 1
        if place < known.first:
            known.first, known.detail = place, detail

    def lines(self) -> list[str]:
        """Return one line for each kind: how often, where first, and what it was there."""
        return [
            f"{kind} ({f'{known.times:,} times, first in ' if known.times > 1 else ''}line {known.first:,}: "
            f"{known.detail})"
            for kind, known in self._kinds.items()
        ]
