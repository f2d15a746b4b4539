"""Systems that are not linear, by fine steps of time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

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


def _second_order(system: System, drive: Drive, extra, band: float) -> np.ndarray:
    """Exact steps of the linear part under a force that is constant over each.

    Parameters
    ----------
    system, drive
        The linear part, of two poles, and what drives it.
    extra : callable
        Restoring force beside that of the linear spring, by deflection, in deflections.
    band : float
        Dry friction in deflections: it stands within so much of its command.
    """
    (natural, damping), *_ = system.pairs
    omega, step = 2 * np.pi * natural, 1 / (FINE * drive.fs)
    t = _fine_time(drive, system.delay)
    u = np.interp(t + 0.5 * step, _fine_time(drive), finely(drive), left=0.0)
    slopes = np.array([[0, 1, 0], [-(omega**2), -2 * damping * omega, omega**2], [0, 0, 0]])
    (a, b, p), (c, d, q), _ = expm(slopes * step).tolist()
    y = v = 0.0
    out = np.empty(u.size)
    for k, target in enumerate(u.tolist()):
        out[k] = y
        wanted = target - extra(y + 0.5 * step * v)
        if band:
            if v == 0.0 and abs(wanted - y) <= band:
                continue
            ahead = v if v != 0.0 else wanted - y
            wanted -= band if ahead > 0 else -band
        further, now = a * y + b * v + p * wanted, c * y + d * v + q * wanted
        if band and now * v < 0:  # it turns within the step: it stands, or is pulled back
            until = step * v / (v - now)
            further, rest = y + 0.5 * v * until, step - until
            pull = target - further
            now = omega**2 * (pull - np.copysign(band, pull)) * rest if abs(pull) > band else 0.0
            further += 0.5 * now * rest
        y, v = further, now
    return system.gain * out[::FINE] + system.bias


def friction(system: System, drive: Drive, band: float) -> np.ndarray:
    """A second-order axis with dry friction: it stands within `band` of its command."""
    return _second_order(system, drive, lambda y: 0.0, band)


def spring(system: System, drive: Drive, cubic: float) -> np.ndarray:
    """A second-order axis whose spring hardens (or, below 0, softens) with deflection."""
    return _second_order(system, drive, lambda y: cubic * y * y * y, 0.0)
