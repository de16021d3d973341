"""How far a trajectory is from the relations a person checked: python tools/truth/relations.py LOG.relations
trajectory.tum.

The metric of Kuemmerle et al. 2009 ("On measuring the accuracy of SLAM algorithms"): for each relation the
motion between two stamps is compared with the true one; its translational and rotational errors are what
counts, so an error in one place is counted once and not carried through the whole map.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lemtomap import se2
from lemtomap.errors import BadInput

STAMP_SLACK_S = 1e-4


def read_relations(path: Path) -> NDArray[np.float64]:
    """Return float64 (R, 5): t1, t2, and the pose at t2 in the frame of t1 as x m, y m, yaw rad."""
    return _table(path, least_columns=8)[:, [0, 1, 2, 3, 7]]


def read_tum(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stamps float64 (N,) and poses float64 (N, 3) of a trajectory in the plane."""
    table = _table(path, least_columns=8)
    yaw = 2.0 * np.arctan2(table[:, 6], table[:, 7])
    return table[:, 0], np.column_stack([table[:, 1], table[:, 2], se2.wrap_angle(yaw)])


def relation_errors(
    relations: NDArray[np.float64], stamps: NDArray[np.float64], poses: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return error poses (M, 3), in the frame of t2; metres of travel between (M,); rows of relations that
    matched.
    """
    order = np.argsort(stamps, kind="stable")
    first, found_first = nearest_stamps(stamps[order], relations[:, 0])
    second, found_second = nearest_stamps(stamps[order], relations[:, 1])
    rows = np.flatnonzero(found_first & found_second)
    a, b = order[first[rows]], order[second[rows]]
    errors = se2.between(relations[rows, 2:5], se2.between(poses[a], poses[b]))
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    return errors, np.abs(way[b] - way[a]), rows


def summary_lines(errors: NDArray[np.float64]) -> list[str]:
    """Return the two lines that the literature prints: translation in m, rotation in degrees."""
    parts = {
        "translation m   ": np.hypot(errors[:, 0], errors[:, 1]),
        "rotation degrees": np.degrees(np.abs(errors[:, 2])),
    }
    return [
        f"{name} mean {x.mean():.4f} +- {x.std():.4f}  median {np.median(x):.4f}  max {x.max():.4f}"
        for name, x in parts.items()
    ]


def nearest_stamps(
    sorted_stamps: NDArray[np.float64], wanted: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the index of the stamp nearest to each one wanted, and whether it is the same one."""
    right = np.clip(np.searchsorted(sorted_stamps, wanted), 1, len(sorted_stamps) - 1)
    left = right - 1
    nearer_left = np.abs(sorted_stamps[left] - wanted) <= np.abs(sorted_stamps[right] - wanted)
    index = np.where(nearer_left, left, right).astype(np.int64)
    return index, np.abs(sorted_stamps[index] - wanted) <= STAMP_SLACK_S


def _table(path: Path, least_columns: int) -> NDArray[np.float64]:
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}") from None
    rows = []
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            row = [float(text) for text in line.split()[:least_columns]]
        except ValueError:
            raise BadInput(f"{path}:{number}: text stands where a number belongs") from None
        if len(row) < least_columns:
            raise BadInput(f"{path}:{number}: {len(row)} columns, {least_columns} are needed")
        rows.append(row)
    if len(rows) < 2:
        raise BadInput(f"{path}: holds {len(rows)} lines with numbers, at least 2 are needed")
    return np.array(rows)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("relations", type=Path)
    parser.add_argument("trajectory", type=Path)
    parser.add_argument(
        "--max-gap", type=float, metavar="M", help="only relations less than M metres of travel apart"
    )
    options = parser.parse_args(arguments)
    try:
        relations = read_relations(options.relations)
        stamps, poses = read_tum(options.trajectory)
    except BadInput as error:
        print(error, file=sys.stderr)
        return 2
    errors, ways_m, rows = relation_errors(relations, stamps, poses)
    if options.max_gap is not None:
        errors = errors[ways_m < options.max_gap]
    if not len(errors):
        print(f"{options.trajectory}: no stamp of it appears in {options.relations}", file=sys.stderr)
        return 2
    print(
        f"relations        {len(errors)} used of {len(relations)} ({len(relations) - len(rows)} have no pose)"
    )
    print("\n".join(summary_lines(errors)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
