"""The five axes: what each may do (Fig. 4), what drives it, and the gimbal it turns."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from hmpim.errors import ArgumentError
from hmpim.rigs.table.bodies import Rigid
from hmpim.stimulus import FIG_4 as LIMITS
from hmpim.stimulus import Limits

__all__ = ["AXES", "FIG_4", "AxisName", "AxisSpec", "CommandMode", "TablePosition"]

AxisName = Literal["roll", "yaw", "pitch", "azimuth", "elevation"]
"""Inner axes carry the unit under test, the outer two the target."""

CommandMode = Literal["P", "PV", "PVA"]
"""Position commands alone; with velocity; with velocity and acceleration."""

AXES: tuple[AxisName, ...] = get_args(AxisName)


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisSpec:
    """One axis of a motion table.

    Parameters
    ----------
    name : str
        One of `AXES`.
    limits : Limits
        Largest commanded position (from the middle of the travel), rate and acceleration.
    bandwidth : float
        Frequency in Hz at which the position lags a position command by 90°, with the
        acceptance loads; the servo is tuned to it.
    torque_limit : float
        Of the actuator, N·m.
    actuator_lag : float
        Time constant of the torque (valve and oil), s.
    damping_ratio : float
        Of the servo's two poles before lags and delays.
    coulomb : float
        Dry friction, N·m.
    viscous : float
        Viscous friction, N·m·s/rad.
    gimbal : Rigid
        What turns with this axis, inner gimbals and loads apart.
    stop_margin : float
        Mechanical stops stand this far beyond the position limit, in the limits' unit.

    Raises
    ------
    ArgumentError
        If a value is out of range.

    Examples
    --------
    >>> FIG_4[0].name, FIG_4[0].limits.velocity, FIG_4[0].bandwidth
    ('roll', 800.0, 43.0)
    """

    name: AxisName
    limits: Limits
    bandwidth: float
    torque_limit: float
    actuator_lag: float
    gimbal: Rigid
    damping_ratio: float = 0.9
    coulomb: float = 0.0
    viscous: float = 0.0
    stop_margin: float = 2.0

    def __post_init__(self) -> None:
        if self.name not in AXES:
            raise ArgumentError(f"axis {self.name!r} is not known; use one of {AXES}")
        for field in ("bandwidth", "torque_limit", "actuator_lag", "damping_ratio", "stop_margin"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{field} = {value!r} of {self.name} must be positive, finite")
        for field in ("coulomb", "viscous"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value >= 0.0):
                raise ArgumentError(f"{field} = {value!r} of {self.name} must be 0 or positive")
        bounds = (self.limits.position, self.limits.velocity, self.limits.acceleration)
        if not all(map(math.isfinite, bounds)):
            raise ArgumentError(f"limits of {self.name} are {bounds}; a table needs all three")


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePosition:
    """Where the five axes stand, in degrees.

    Examples
    --------
    >>> TablePosition(yaw=30.0).yaw
    30.0
    """

    roll: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    azimuth: float = 0.0
    elevation: float = 0.0

    def __post_init__(self) -> None:
        for axis in AXES:
            if not math.isfinite(getattr(self, axis)):
                raise ArgumentError(f"{axis} = {getattr(self, axis)!r} deg is not a position")


# Limits and bandwidths: Fig. 4. Torque: what the acceleration limit takes with the acceptance
# load, and a quarter more. Friction: 1 to 1.3 % of the torque for the seals, and about 3 % of
# it at full rate. All others: sizes usual for such a table, see docs/table.md.
FIG_4: tuple[AxisSpec, ...] = (
    AxisSpec(
        name="roll",
        limits=LIMITS["roll"],
        bandwidth=43.0,
        torque_limit=390.0,
        actuator_lag=0.9e-3,
        coulomb=4.0,
        viscous=0.9,
        gimbal=Rigid(mass=45.0, inertia=(0.18, 0.90, 0.90), products=(0.0, 0.010, 0.0)),
    ),
    AxisSpec(
        name="yaw",
        limits=LIMITS["yaw"],
        bandwidth=25.0,
        torque_limit=1550.0,
        actuator_lag=1.6e-3,
        coulomb=20.0,
        viscous=6.0,
        gimbal=Rigid(mass=110.0, inertia=(3.0, 3.2, 2.6), products=(0.02, 0.03, 0.05)),
    ),
    AxisSpec(
        name="pitch",
        limits=LIMITS["pitch"],
        bandwidth=20.0,
        torque_limit=4600.0,
        actuator_lag=2.0e-3,
        coulomb=60.0,
        viscous=35.0,
        gimbal=Rigid(mass=220.0, inertia=(14.0, 10.0, 12.0)),
    ),
    AxisSpec(
        name="azimuth",
        limits=LIMITS["azimuth"],
        bandwidth=9.5,
        torque_limit=16_600.0,
        actuator_lag=4.2e-3,
        coulomb=200.0,
        viscous=150.0,
        gimbal=Rigid(mass=700.0, inertia=(350.0, 250.0, 400.0), products=(0.0, 0.0, 8.0)),
    ),
    AxisSpec(
        name="elevation",
        limits=LIMITS["elevation"],
        bandwidth=7.0,
        torque_limit=21_600.0,
        actuator_lag=5.7e-3,
        coulomb=250.0,
        viscous=200.0,
        gimbal=Rigid(mass=1500.0, inertia=(900.0, 500.0, 800.0)),
    ),
)
