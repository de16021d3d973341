"""Numbers out of text, or the one line that says where they are not."""

import math
from collections.abc import Sequence
from pathlib import Path

from lemtomap.errors import BadLog


def finite(path: Path, line_number: int, texts: Sequence[str]) -> list[float]:
    """Return the texts as finite floats; raises BadLog with file, line and the offending text."""
    try:
        values = list(map(float, texts))
    except ValueError:
        culprit = next(text for text in texts if not _is_number(text))
        raise BadLog(f"{path}:{line_number}: '{culprit}' stands where a number belongs") from None
    if not all(map(math.isfinite, values)):
        culprit = next(t for t, v in zip(texts, values, strict=True) if not math.isfinite(v))
        raise BadLog(f"{path}:{line_number}: '{culprit}' is not a finite number")
    return values


def readings(path: Path, line_number: int, texts: Sequence[str]) -> list[float]:
    """Return the texts as floats, NaN where one is not finite: a reading less does no harm. Raises BadLog
    where text stands.
    """
    try:
        values = list(map(float, texts))
    except ValueError:
        return finite(path, line_number, texts)
    return [value if math.isfinite(value) else math.nan for value in values]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
