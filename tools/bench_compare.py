"""What got better or worse between two reports of a bench: lemtomap bench compare OLD.json NEW.json."""

import json
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

NOISE = 0.05  # ratios this near to 1 say nothing on a shared machine


def numbers(report: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number of a report with its path."""
    for key, value in report.items():
        if isinstance(value, Mapping):
            yield from numbers(value, f"{prefix}{key} ")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{prefix}{key}", float(value)


def compare(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    """Return a line for each number that changed by more than the noise: old, new, ratio."""
    before = dict(numbers(old))
    lines = []
    for name, value in numbers(new):
        if name not in before or before[name] == 0.0 or value != value:  # noqa: PLR0124 - not a number
            continue
        ratio = value / before[name]
        if abs(ratio - 1.0) > NOISE:
            lines.append(f"{name:<60} {before[name]:>12.4g} -> {value:<12.4g} x{ratio:.2f}")
    return "\n".join(lines) or f"nothing changed by more than {NOISE:.0%}"


def main(arguments: list[str]) -> int:
    if len(arguments) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        old, new = (json.loads(Path(name).read_text()) for name in arguments)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    print(compare(old, new))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
