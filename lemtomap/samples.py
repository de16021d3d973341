"""What an argument's numbers must be: taken as they are where they fit, made to fit from lists, else refused.

An array that is right already costs a look at its type and shape; it is not copied, and must not be written
to afterwards.
"""

import math
import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import BadSample

_LONGEST = 60  # characters of a value that are shown


def as_row(what: str, values: Any, dtype: Any, length: int | None = None) -> NDArray[Any]:
    """Return values as one row of numbers, dtype (N,), N = `length` if given. Raises BadSample."""
    row = _array(what, values, dtype)
    if length is not None and row.shape != (length,):
        raise BadSample(f"{what}: must be {length} numbers, has shape {row.shape}")
    if row.ndim != 1:
        raise BadSample(f"{what}: must be one row of numbers, has shape {row.shape}")
    return row


def as_pose(what: str, values: Any) -> NDArray[np.float64]:
    """Return a pose, float64 (3,): x m, y m, yaw rad. Raises BadSample."""
    return as_row(f"{what} (x m, y m, yaw rad)", values, np.float64, 3)


def as_finite(what: str, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the numbers if all are finite. Raises BadSample."""
    if not np.isfinite(pose).all():
        raise BadSample(f"{what}: must be finite, is {pose.tolist()}")
    return pose


def as_points(what: str, values: Any) -> NDArray[np.floating]:
    """Return points, float64 (N, 2), metres; float32 is left as it is, nothing is N = 0. Raises BadSample."""
    is_fit = isinstance(values, np.ndarray) and values.dtype == np.float32
    points = _array(what, values, np.float32 if is_fit else np.float64)
    if points.size == 0:
        return points.reshape(0, 2)
    if points.ndim != 2 or points.shape[1] != 2:
        raise BadSample(f"{what}: must be points (N, 2), has shape {points.shape}")
    return points


def as_poses(what: str, values: Any) -> NDArray[np.float64]:
    """Return poses, float64 (N, 3): x m, y m, yaw rad, all finite. Raises BadSample."""
    poses = _array(what, values, np.float64)
    if poses.ndim != 2 or poses.shape[1] != 3:
        raise BadSample(f"{what}: must be poses (N, 3), has shape {poses.shape}")
    if not np.isfinite(poses).all():
        raise BadSample(f"{what}: must be finite")
    return poses


def as_number(what: str, value: Any, unit: str, least: float = -math.inf, *, endless: bool = False) -> float:
    """Return one finite number of at least `least`; `endless`: +inf will do too. Raises BadSample."""
    if not isinstance(value, float | int | np.floating | np.integer) or isinstance(value, bool):
        raise BadSample(f"{what}: must be a number of {unit}, is {shown(value)}")
    number = float(value)
    if math.isnan(number) or number == -math.inf or (number == math.inf and not endless):
        raise BadSample(f"{what}: must be a finite number of {unit}, is {number}")
    if number < least:
        raise BadSample(f"{what}: must be at least {least:g} {unit}, is {number:g}")
    return number


def as_whole(what: str, value: Any, least: int = 0) -> int:
    """Return a whole number of at least `least`. Raises BadSample."""
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError  # noqa: TRY301 - told below, as what is no whole number either
        number = operator.index(value)
    except TypeError:
        raise BadSample(f"{what}: must be a whole number, is {shown(value)}") from None
    if number < least:
        raise BadSample(f"{what}: must be at least {least}, is {number}")
    return number


def check_kind(what: str, value: Any, *kinds: type) -> None:
    """Refuse a value that is of none of these kinds. Raises BadSample."""
    if not isinstance(value, kinds):
        names = " or ".join("None" if kind is type(None) else kind.__name__ for kind in kinds)
        raise BadSample(f"{what}: must be of kind {names}, is {shown(value)}")


def shown(value: Any) -> str:
    """Return a value as it is shown within a line: cut if long."""
    text = " ".join(repr(value).split())
    return text if len(text) < _LONGEST else f"{text[: _LONGEST - 4]} ..."


def _array(what: str, values: Any, dtype: Any) -> NDArray[Any]:
    if isinstance(values, np.ndarray) and values.dtype == dtype:
        return values
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiu":
            raise TypeError  # noqa: TRY301 - told below, as what numpy itself refuses
    except (TypeError, ValueError):
        raise BadSample(f"{what}: must be numbers, is {shown(values)}") from None
    with np.errstate(over="ignore"):  # beyond float32 is infinitely far
        return array.astype(dtype)
