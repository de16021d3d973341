"""What the battery's voltage and the charger's byte mean, debounced. Pure: time is an argument."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Generic, TypeVar

from lemtomap.drivers.kobuki.packets import CHARGER_ADAPTER, Charge


@dataclass(frozen=True, slots=True)
class BatteryConfig:
    """Thresholds of the 4-cell lithium-ion pack."""

    full_v: float = 16.5  # kobuki_core, battery.hpp: capacity
    low_v: float = 14.0  # kobuki_core
    critical_v: float = 13.2  # kobuki_core: dangerous
    level_hold_s: float = 3.0  # starting motors pull the voltage down for less
    charger_hold_s: float = 1.5  # old firmware says "charged" for about 1 s after plugging in (kobuki#137)


class ChargeLevel(StrEnum):
    """How much is left."""

    FULL = "full"
    HEALTHY = "healthy"
    LOW = "low"
    CRITICAL = "critical"


class PowerSource(StrEnum):
    """Where the charging current comes from."""

    NONE = "none"
    ADAPTER = "adapter"
    DOCK = "dock"


class PowerChange(StrEnum):
    """What happened to the power supply."""

    UNPLUGGED = "unplugged"
    PLUGGED_TO_ADAPTER = "plugged to the adapter"
    PLUGGED_TO_DOCK = "plugged to the dock"
    CHARGE_COMPLETED = "charge completed"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"


@dataclass(frozen=True, slots=True)
class Battery:
    """State of the power supply, debounced but for the voltage."""

    voltage_v: float
    percent: float
    level: ChargeLevel
    source: PowerSource
    charge: Charge

    @property
    def charging(self) -> bool:
        """Return True if current flows into the pack."""
        return self.charge is Charge.CHARGING


_FALLING = {ChargeLevel.LOW: PowerChange.BATTERY_LOW, ChargeLevel.CRITICAL: PowerChange.BATTERY_CRITICAL}
_FROM_FULL_DOWN = list(ChargeLevel)

_T = TypeVar("_T")


class _Held(Generic[_T]):
    """A value that changes only when the new one has been seen without a break for `hold_s`."""

    def __init__(self, value: _T, hold_s: float) -> None:
        self.value = value
        self._hold_s = hold_s
        self._candidate = value
        self._since_s = 0.0

    def update(self, seen: _T, stamp_s: float) -> bool:
        """Return True if the value changed."""
        if seen != self._candidate:
            self._candidate, self._since_s = seen, stamp_s
        if seen == self.value or stamp_s - self._since_s < self._hold_s:
            return False
        self.value = seen
        return True


class BatteryModel:
    """Follows the battery of one robot."""

    def __init__(self, config: BatteryConfig) -> None:
        self._config = config
        self._full_v = config.full_v
        self._charger: _Held[int] | None = None
        self._level: _Held[ChargeLevel] | None = None

    def update(self, voltage_v: float, charger: int, stamp_s: float) -> tuple[Battery, list[PowerChange]]:
        """Take one packet's voltage and charger byte; return the state and what changed."""
        changes = self._follow_charger(charger, stamp_s)
        charge, source = _read_charger(self._charger.value if self._charger else charger)
        if PowerChange.CHARGE_COMPLETED in changes:
            self._full_v = max(
                voltage_v, self._config.low_v
            )  # the pack ages: full is where it stops charging
        changes += self._follow_level(self._level_of(voltage_v, charge), stamp_s)
        level = self._level.value if self._level else ChargeLevel.HEALTHY
        return Battery(voltage_v, self._percent(voltage_v), level, source, charge), changes

    def _follow_charger(self, charger: int, stamp_s: float) -> list[PowerChange]:
        if self._charger is None:
            self._charger = _Held(charger, self._config.charger_hold_s)
        before, before_source = _read_charger(self._charger.value)
        if not self._charger.update(charger, stamp_s):
            return []
        charge, source = _read_charger(charger)
        changes = []
        if source is not before_source:
            changes.append(_PLUGGED[source])
        if charge is Charge.CHARGED and before is not Charge.CHARGED:
            changes.append(PowerChange.CHARGE_COMPLETED)
        return changes

    def _follow_level(self, level: ChargeLevel, stamp_s: float) -> list[PowerChange]:
        if self._level is None:
            self._level = _Held(level, self._config.level_hold_s)
            return [_FALLING[level]] if level in _FALLING else []
        before = self._level.value
        if not self._level.update(level, stamp_s) or _FROM_FULL_DOWN.index(level) < _FROM_FULL_DOWN.index(
            before
        ):
            return []
        return [_FALLING[level]] if level in _FALLING else []

    def _level_of(self, voltage_v: float, charge: Charge) -> ChargeLevel:
        if charge is Charge.CHARGED:
            return ChargeLevel.FULL
        if voltage_v > self._config.low_v:
            return ChargeLevel.HEALTHY
        return ChargeLevel.LOW if voltage_v > self._config.critical_v else ChargeLevel.CRITICAL

    def _percent(self, voltage_v: float) -> float:
        c = self._config
        return max(0.0, min(100.0, 5.0 + 95.0 * (voltage_v - c.critical_v) / (self._full_v - c.critical_v)))


_PLUGGED = {
    PowerSource.NONE: PowerChange.UNPLUGGED,
    PowerSource.ADAPTER: PowerChange.PLUGGED_TO_ADAPTER,
    PowerSource.DOCK: PowerChange.PLUGGED_TO_DOCK,
}


def _read_charger(charger: int) -> tuple[Charge, PowerSource]:
    charge = Charge(charger & ~CHARGER_ADAPTER)
    if charge is Charge.DISCHARGING:
        return charge, PowerSource.NONE
    return charge, PowerSource.ADAPTER if charger & CHARGER_ADAPTER else PowerSource.DOCK
