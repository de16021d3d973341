"""One row of the table: what was asked, what came out, over how many runs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tools.bench.parts.mapping_runs import table

HEADER = ["figure", "median", "worst", "runs", "wanted", "met"]


@dataclass(frozen=True, slots=True)
class Figure:
    """A measured figure, less being better."""

    name: str
    values: list[float]
    """One a seed or start."""
    unit: str
    wanted: float | None = None
    """The worst of `values` must not be more."""

    @property
    def met(self) -> bool | None:
        """Whether the worst run is good enough; None when nothing is asked."""
        return None if self.wanted is None else max(self.values) <= self.wanted

    def cells(self) -> list[str]:
        """Return the row."""
        met = {True: "yes", False: "**no**", None: ""}[self.met]
        wanted = "" if self.wanted is None else f"{self.wanted:g} {self.unit}"
        median, worst = (f"{x:.4g} {self.unit}" for x in (np.median(self.values), max(self.values)))
        return [self.name, median, worst, str(len(self.values)), wanted, met]


def markdown(figures: Sequence[Figure]) -> str:
    """Return the table."""
    return table(HEADER, [figure.cells() for figure in figures])
