"""Where the beams of a scan point, told from what a log says of its laser.

A fan of n beams over a field of view: an odd number has a beam at both ends; of an even number the last beam
is left out, so that 180 beams over 180 degrees stand 1 degree apart like 181. Angles are radians.
"""

import math
from dataclasses import dataclass

STEP_URG = 360.0 / 1024.0
KNOWN_FANS_DEG = {  # beams: field of view and step that CARMEN takes for them
    180: (180.0, 1.0),
    181: (180.0, 1.0),
    360: (180.0, 0.5),
    361: (180.0, 0.5),
    400: (100.0, 0.25),
    401: (100.0, 0.25),
    541: (270.0, 0.5),
    682: (681 * STEP_URG, STEP_URG),
    683: (682 * STEP_URG, STEP_URG),
    769: (270.0, STEP_URG),
    1081: (270.0, 0.25),
}
LARGEST_STEP_RAD = 0.05  # a resolution above it is in degrees
ROUNDED = 0.005  # how far off, as a share, what a log says of one and the same angle may be


class UnknownFan(Exception):
    """What a log says does not tell where its beams point; the text is the reason."""


@dataclass(frozen=True, slots=True)
class Fan:
    """Beam i points to angle_min + i * step, counter-clockwise from straight ahead."""

    angle_min_rad: float
    step_rad: float


def fan_over(beams: int, fov_rad: float) -> Fan:
    """Return the fan of so many beams over a field of view, straight ahead in its middle."""
    known = known_fan(beams)
    if known is not None and _alike(_fov(known), fov_rad):
        return known
    return Fan(-fov_rad / 2.0, fov_rad / _gaps(beams))


def known_fan(beams: int) -> Fan | None:
    """Return the fan that CARMEN takes for a number of beams, None for a number it does not know."""
    if beams not in KNOWN_FANS_DEG:
        return None
    fov_deg, step_deg = KNOWN_FANS_DEG[beams]
    return Fan(math.radians(-fov_deg / 2.0), math.radians(step_deg))


def fan_told(beams: int, fov: float | None, resolution: float | None) -> Fan:
    """Return the fan that a log's settings tell, degrees or radians; None: the log does not say.

    Where they contradict each other, the number of beams decides. Raises UnknownFan when nothing fits.
    """
    known = known_fan(beams)
    if fov is None and resolution is None:
        if known is None:
            raise UnknownFan(f"a scan of {beams} beams: nothing says what field of view they cover")
        return known
    fov_rad = None if fov is None else _radians(fov, 2.0 * math.pi)
    step_rad = None if resolution is None else _radians(resolution, LARGEST_STEP_RAD)
    if fov_rad is None:
        assert step_rad is not None  # noqa: S101
        return fan_over(beams, _within_a_turn(beams, _gaps(beams) * step_rad))
    if step_rad is None or _fits(beams, fov_rad, step_rad):
        return fan_over(beams, _within_a_turn(beams, fov_rad))
    if known is not None and (_alike(_fov(known), fov_rad) or _alike(known.step_rad, step_rad)):
        return known
    raise _contradiction(beams, fov_rad, step_rad)


def fan_of_line(beams: int, start_rad: float, fov_rad: float, step_rad: float) -> Fan:
    """Return the fan of a laser line that brings its own start angle, field of view and resolution, radians.

    Where the last two contradict each other, the one that the start angle agrees with decides. Raises
    UnknownFan when nothing fits.
    """
    _within_a_turn(beams, max(fov_rad, _gaps(beams) * step_rad))
    if step_rad > 0.0 and (fov_rad <= 0.0 or _fits(beams, fov_rad, step_rad)):
        return Fan(start_rad, step_rad)
    if fov_rad > 0.0 and (step_rad <= 0.0 or _alike(-2.0 * start_rad, fov_rad)):
        return Fan(start_rad, fov_rad / _gaps(beams))
    if step_rad > 0.0 and _fits(beams, -2.0 * start_rad, step_rad):
        return Fan(start_rad, step_rad)
    raise _contradiction(beams, fov_rad, step_rad)


def _contradiction(beams: int, fov_rad: float, step_rad: float) -> UnknownFan:
    fov_deg, step_deg = math.degrees(fov_rad), math.degrees(step_rad)
    return UnknownFan(f"a scan of {beams} beams is not {fov_deg:g} degrees with a beam every {step_deg:g}")


def _gaps(beams: int) -> int:
    """Return how many steps make the field of view."""
    return beams - 1 if beams % 2 else beams


def _fov(fan: Fan) -> float:
    return -2.0 * fan.angle_min_rad


def _alike(one: float, other: float) -> bool:
    return abs(one - other) <= ROUNDED * abs(other)


def _fits(beams: int, fov_rad: float, step_rad: float) -> bool:
    """Return True if so many beams make this field of view, however its ends are counted."""
    return min(abs(beams * step_rad - fov_rad), abs((beams - 1) * step_rad - fov_rad)) <= max(
        0.5 * step_rad, ROUNDED * fov_rad
    )


def _radians(angle: float, largest_rad: float) -> float:
    """Return an angle given in radians or, above the largest that radians can be, in degrees."""
    return angle if angle <= largest_rad * (1.0 + ROUNDED) else math.radians(angle)


def _within_a_turn(beams: int, fov_rad: float) -> float:
    if not 0.0 < fov_rad <= 2.0 * math.pi * (1.0 + ROUNDED):
        raise UnknownFan(f"a scan of {beams} beams: over {math.degrees(fov_rad):g} degrees")
    return fov_rad
