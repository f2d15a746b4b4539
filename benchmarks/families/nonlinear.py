"""Systems that are not linear, by fine steps of time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from families.drive import Drive, Samples
from families.simulate import linear_output
from families.system import System

__all__ = [
    "FINE",
    "backlash",
    "dead_zone",
    "finely",
    "friction",
    "play",
    "slew_limited",
    "spring",
    "through",
]

FINE = 24
"""Steps to a sample."""


def _fine_time(drive: Drive, late: float = 0.0) -> np.ndarray:
    count = (drive.samples - 1) * FINE + 1
    return np.arange(count) / (FINE * drive.fs) - late


def finely(drive: Drive) -> np.ndarray:
    """The input on the fine clock, from time 0 on."""
    t = _fine_time(drive)
    if drive.between == "smooth":
        return drive.source(t)
    index = np.floor(t * drive.fs + 1e-6).astype(int)
    low = drive.sampled(0.0, drive.samples + 1)
    return (
        low[index] if drive.between == "zoh" else np.interp(t, np.arange(low.size) / drive.fs, low)
    )


def through(system: System, drive: Drive, fine: np.ndarray) -> np.ndarray:
    """A linear system behind an input that is known, and straight, on the fine clock; so is y."""
    rate = FINE * drive.fs
    quick = replace(
        drive, source=Samples(fine, rate), between="foh", fs=rate, samples=fine.size, quiet=True
    )
    return linear_output(system, quick)


def dead_zone(u: np.ndarray, half: float) -> np.ndarray:
    return np.sign(u) * np.maximum(np.abs(u) - half, 0.0)


def slew_limited(u: np.ndarray, most: float) -> np.ndarray:
    """Follow as fast as `most` a step allows."""
    out = np.empty_like(u)
    here = u[0]
    for k, wanted in enumerate(u.tolist()):
        here += min(max(wanted - here, -most), most)
        out[k] = here
    return out


def play(u: np.ndarray, half: float) -> np.ndarray:
    """Backlash: the output moves when the input pushes it."""
    out = np.empty_like(u)
    here = u[0]
    for k, at in enumerate(u.tolist()):
        here = min(max(here, at - half), at + half)
        out[k] = here
    return out


def backlash(system: System, drive: Drive, half: float) -> np.ndarray:
    """Play behind a linear system, on the record's clock."""
    inner = through(replace(system, bias=0.0), drive, finely(drive))
    return play(inner, half)[::FINE] + system.bias


def _second_order(system: System, drive: Drive, force, grip: float) -> np.ndarray:
    (natural, damping), *_ = system.pairs
    omega, step = 2 * np.pi * natural, 1 / (FINE * drive.fs)
    t = _fine_time(drive, system.delay)
    u = np.interp(t, _fine_time(drive), finely(drive), left=0.0)
    hold = step * grip
    y = v = 0.0
    out = np.empty(u.size)
    for k, target in enumerate(u.tolist()):
        out[k] = y
        v += step * (omega**2 * (target - force(y)) - 2 * damping * omega * v)
        v = 0.0 if abs(v) <= hold else v - hold * (1.0 if v > 0 else -1.0)
        y += step * v
    return system.gain * out[::FINE] + system.bias


def friction(system: System, drive: Drive, band: float) -> np.ndarray:
    """A second-order axis with dry friction: it stands within `band` of its command."""
    (natural, _), *_ = system.pairs
    return _second_order(system, drive, lambda y: y, band * (2 * np.pi * natural) ** 2)


def spring(system: System, drive: Drive, cubic: float) -> np.ndarray:
    """A second-order axis whose spring hardens (or, below 0, softens) with deflection."""
    return _second_order(system, drive, lambda y: y + cubic * y * y * y, 0.0)
