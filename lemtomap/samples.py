"""What a sample's numbers must be: taken as they are where they fit, made to fit from lists, else refused.

An array that is right already costs a look at its type and shape.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lemtomap.errors import BadSample


def as_row(what: str, values: Any, dtype: Any, length: int | None = None) -> NDArray[Any]:
    """Return values as one row of numbers, dtype (N,), N = `length` if given. Raises BadSample."""
    if isinstance(values, np.ndarray) and values.dtype == dtype and values.ndim == 1:
        row = values
    else:
        row = _converted(what, values, dtype)
    if length is not None and row.shape != (length,):
        raise BadSample(f"{what}: must be {length} numbers, has shape {row.shape}")
    if row.ndim != 1:
        raise BadSample(f"{what}: must be one row of numbers, has shape {row.shape}")
    return row


def as_pose(what: str, values: Any) -> NDArray[np.float64]:
    """Return a pose, float64 (3,): x m, y m, yaw rad. Raises BadSample."""
    return as_row(f"{what} (x m, y m, yaw rad)", values, np.float64, 3)


def _converted(what: str, values: Any, dtype: Any) -> NDArray[Any]:
    try:
        array = np.asarray(values)
        if array.dtype.kind not in "fiu":
            raise TypeError  # noqa: TRY301 - told below, as what numpy itself refuses
        return array.astype(dtype)
    except (TypeError, ValueError):
        shown = repr(values)
        shown = shown if len(shown) < 60 else f"{shown[:56]} ..."
        raise BadSample(f"{what}: must be numbers, is {shown}") from None
