"""Exact response of a linear system to an input that is known at every instant.

Each mode obeys x' = p x + u(t - delay). Between two output samples the integral of
e^(p(h - s)) u(s) is taken by Gauss and Legendre's rule on sub-steps that end where a held or
linear input breaks, so a held input is exact to rounding and a smooth one to 1e-9.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.signal import lfilter

from families.drive import Between, Drive
from families.system import System

__all__ = ["linear_output"]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_FEW, _LIGHT = np.polynomial.legendre.leggauss(3)
_LONG = 150_000


def linear_output(
    system: System,
    drive: Drive,
    *,
    start: float = 0.0,
    samples: int | None = None,
    between: Between | None = None,
) -> np.ndarray:
    """Output at start + k/fs, bias included; `between` puts another input between the samples."""
    between = between or drive.between
    step = 1.0 / drive.fs
    count = drive.samples if samples is None else samples
    modal = system.modal()
    ahead = _history(system, drive, start)
    first = start - ahead * step
    time = first + step * np.arange(count + ahead)
    late = system.delay
    y = np.full(time.size, system.bias)
    if modal.direct:
        y = y + modal.direct * drive.value(time - late, between)
    if modal.poles.size:
        nodes, weights = _rule(modal.poles, drive, late, between)
        rows = np.stack([drive.value(time[:-1] + s - late, between) for s in nodes])
        level = drive.value(time[:1] - late, between)[0]
        for p, r, twice in _half(modal):
            kernel = weights * np.exp(p * (step - nodes))
            forcing = (kernel.real @ rows) + 1j * (kernel.imag @ rows)
            x0 = 0.0 if p == 0 else -level / p
            a = np.exp(p * step)
            forced = np.concatenate([[x0], forcing])
            x = lfilter([1.0], [1.0, -a], forced if p.imag else forced.real + 0j)
            y = y + twice * (r * x).real
    return y[ahead:]


def _half(modal) -> list[tuple[complex, complex, float]]:
    """Of each conjugate pair one, counted twice."""
    pairs = zip(modal.poles, modal.residues, strict=True)
    return [(p, r, 2.0 if p.imag > 0 else 1.0) for p, r in pairs if p.imag >= 0]


def _history(system: System, drive: Drive, start: float) -> int:
    """Samples before the record that its beginning still remembers."""
    since = max(start - system.delay, 0.0)  # how long a quiet input has moved
    moving = [-1.0 / p.real for p in system.poles() if p.real < 0]
    memory = min(25 * max(moving, default=0.0), 10 * drive.duration)
    if drive.quiet:
        memory = min(memory, since)
    return int(np.ceil(memory * drive.fs)) + 1 if memory else 0


def _rule(
    poles: np.ndarray, drive: Drive, late: float, between: Between
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights inside one sampling interval."""
    step = 1.0 / drive.fs
    long = drive.samples > _LONG
    base, share = (_FEW, _LIGHT) if long else (_NODES, _WEIGHTS)
    fastest = float(np.max(np.abs(poles))) * step
    if between == "smooth":
        turn = 2 * np.pi * drive.band[1] * step
        edges = np.array([0.0, 1.0])
        parts = max(1 if long else 2, int(np.ceil(max(fastest, turn) / 0.9)))
    else:
        edges = np.array([0.0, (late * drive.fs) % 1.0, 1.0])
        parts = max(1, int(np.ceil(fastest / 0.9)))
    cuts = [np.linspace(a, b, parts + 1) for a, b in itertools.pairwise(edges) if b > a]
    nodes, weights = [], []
    for cut in cuts:
        for a, b in itertools.pairwise(cut):
            nodes.append((a + b) / 2 + (b - a) / 2 * base)
            weights.append((b - a) / 2 * share)
    return np.concatenate(nodes) * step, np.concatenate(weights) * step
