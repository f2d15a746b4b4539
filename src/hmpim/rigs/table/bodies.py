"""Rigid bodies of the table: the block it stands on, and the loads it carries."""

import math
from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np

from hmpim.errors import ArgumentError

__all__ = ["LOADS", "Base", "LoadName", "Rigid", "both_loads", "load_named"]

LoadName = Literal["acceptance", "bracket", "projector", "none"]

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rigid:
    """A rigid body in the table's axes: x forward, y to the left, z up.

    Parameters
    ----------
    mass : float
        In kg.
    inertia : tuple of float
        Ixx, Iyy, Izz about the centre of mass, kg·m².
    products : tuple of float
        Off-diagonal elements Ixy, Ixz, Iyz of the inertia matrix, kg·m².
    centre : tuple of float
        Centre of mass from where the axes meet, m.

    Raises
    ------
    ArgumentError
        If no body can have this inertia.

    Examples
    --------
    >>> Rigid(mass=1.0, inertia=(1.0, 1.0, 3.0))
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: inertia = (1.0, 1.0, 3.0) with products (0.0, 0.0, 0.0) kg·m² ...
    """

    mass: float
    inertia: Vector
    products: Vector = (0.0, 0.0, 0.0)
    centre: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        numbers = (self.mass, *self.inertia, *self.products, *self.centre)
        if len(numbers) != 10 or not all(map(math.isfinite, numbers)) or self.mass <= 0.0:
            raise ArgumentError(f"{self!r} needs a positive mass and three finite numbers each")
        (xx, yy, zz), (xy, xz, yz) = self.inertia, self.products
        principal = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        if principal[0] <= 0.0 or principal[2] > principal[0] + principal[1]:
            raise ArgumentError(
                f"inertia = {self.inertia} with products {self.products} kg·m² belongs to no body: "
                "principal moments are positive, and none is more than the sum of the others"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """The block under the table, rocking and twisting on its ground.

    Both gimbal sets stand on it: what one pushes with, the other feels.

    Parameters
    ----------
    mass : float
        In kg.
    inertia : tuple of float
        About x, y, z through the point it rocks about, kg·m².
    height : float
        From that point up to where the axes meet, m.
    frequency : tuple of float
        Of rocking about x and y and of twisting about z, Hz.
    damping_ratio : float
        Of each; the ground takes energy away.

    Raises
    ------
    ArgumentError
        If a value is not positive.

    Examples
    --------
    >>> Base().stiffness[0] > 1e9
    True
    """

    mass: float = 57_000.0
    inertia: Vector = (90_000.0, 90_000.0, 150_000.0)
    height: float = 2.0
    frequency: Vector = (25.0, 25.0, 30.0)
    damping_ratio: float = 0.15

    def __post_init__(self) -> None:
        numbers = (self.mass, self.height, self.damping_ratio, *self.inertia, *self.frequency)
        if len(numbers) != 9 or not all(math.isfinite(x) and x > 0.0 for x in numbers):
            raise ArgumentError(f"{self!r}: every number of it must be positive and finite")

    @property
    def stiffness(self) -> Vector:
        """Of the ground about x, y, z, N·m/rad."""
        k = [i * (math.tau * f) ** 2 for i, f in zip(self.inertia, self.frequency, strict=True)]
        return (k[0], k[1], k[2])

    @property
    def damping(self) -> Vector:
        """Of the ground about x, y, z, N·m·s/rad."""
        zeta = self.damping_ratio
        c = [
            2.0 * zeta * i * math.tau * f for i, f in zip(self.inertia, self.frequency, strict=True)
        ]
        return (c[0], c[1], c[2])


# The acceptance masses are balanced; what is really carried is neither balanced nor symmetric.
LOADS: dict[tuple[Literal["uut", "target"], LoadName], Rigid | None] = {
    ("uut", "none"): None,
    ("uut", "acceptance"): Rigid(mass=45.0, inertia=(0.36, 0.95, 0.95)),
    ("uut", "bracket"): Rigid(
        mass=70.0,
        inertia=(0.56, 2.10, 2.00),
        products=(0.03, 0.06, 0.0),
        centre=(0.03, 0.004, -0.006),
    ),
    ("target", "none"): None,
    ("target", "acceptance"): Rigid(mass=150.0, inertia=(60.0, 350.0, 360.0)),
    ("target", "projector"): Rigid(
        mass=260.0,
        inertia=(120.0, 620.0, 640.0),
        products=(10.0, 25.0, 15.0),
        centre=(0.02, 0.0, 0.01),
    ),
}


def load_named(gimbal: Literal["uut", "target"], load: LoadName | Rigid) -> Rigid | None:
    """Body of a load by its name; a body is returned as given.

    Parameters
    ----------
    gimbal : {'uut', 'target'}
        Which set of axes carries it.
    load : str or Rigid
        Name of a load, or one of your own.

    Raises
    ------
    ArgumentError
        If this gimbal has no load of that name.

    Examples
    --------
    >>> load_named("uut", "acceptance").mass
    45.0
    """
    if isinstance(load, Rigid):
        return load
    if load not in get_args(LoadName) or (gimbal, load) not in LOADS:
        known = [name for where, name in LOADS if where == gimbal]
        raise ArgumentError(f"the {gimbal} gimbal carries no load {load!r}; choose one of {known}")
    return LOADS[gimbal, load]


def both_loads(name: str) -> tuple[LoadName, LoadName]:
    """Loads of the inner and the outer axes from one name; 'a+b' is a inside, b outside.

    Raises
    ------
    ArgumentError
        If there is no such load.

    Examples
    --------
    >>> both_loads("bracket"), both_loads("bracket+projector")
    (('bracket', 'acceptance'), ('bracket', 'projector'))
    """
    inner, plus, outer = name.partition("+")
    if not plus:
        sides = {"bracket": (inner, "acceptance"), "projector": ("acceptance", inner)}
        inner, outer = sides.get(inner, (inner, inner))
    for load in (inner, outer):
        if load not in get_args(LoadName):
            raise ArgumentError(
                f"load {name!r} is not known; use {', '.join(get_args(LoadName))}, or two joined "
                "by +, such as bracket+projector"
            )
    return cast("LoadName", inner), cast("LoadName", outer)
