"""A plant in a digital loop: held commands, a PI controller, noise that goes round."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from families.system import System

__all__ = ["Controller", "closed", "margin_of", "tuned"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """u = proportional · e + integral · sum of e."""

    proportional: float
    integral: float


def margin_of(system: System, fs: float) -> tuple[float, float]:
    """Frequency in Hz at which the plant lags 180° behind what it answers to, and its gain there.

    The command is held and a sample late.
    """
    f = np.geomspace(1e-3, 0.5, 4000) * fs
    held = np.sinc(f / fs) * np.exp(-3j * np.pi * f / fs)
    value = system.response(f) * held / np.sign(system.scale_factor)
    turned = np.unwrap(np.angle(value))
    turned -= 2 * np.pi * np.round((turned[0] + 0.5 * np.pi * system.integrators) / (2 * np.pi))
    below = np.flatnonzero(turned <= -np.pi)
    i = below[0] if below.size else f.size - 1
    return float(f[i]), float(np.abs(value[i]))


def tuned(system: System, fs: float, *, share: float) -> Controller:
    """PI at a share of the gain at which the loop would oscillate; a loop gain of 20 at most."""
    place, gain = margin_of(system, fs)
    level = abs(float(np.abs(system.response(np.array([place / 50])))[0]))
    sign = float(np.sign(system.scale_factor))
    proportional = sign * min(share / gain, 20.0 / level)
    integral = 0.0 if system.integrators else proportional * 2 * np.pi * place / 8 / fs
    return Controller(proportional=proportional, integral=integral)


def closed(
    system: System,
    controller: Controller,
    reference: np.ndarray,
    noise: np.ndarray,
    fs: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Command u and output y (noise included) of the loop, from rest.

    The command that stands from sample k on is made of the output's sample k - 1: the
    computer needs an interval to think.
    """
    modal = system.modal()
    if modal.direct or system.delay < 0:
        raise ValueError("a loop needs a strictly proper plant and no lead in time")
    step = 1.0 / fs
    keep = modal.poles.imag >= 0
    poles, residues = modal.poles[keep], modal.residues[keep]
    residues = np.where(poles.imag > 0, 2.0, 1.0) * residues
    whole = int(np.floor(system.delay * fs))
    part = system.delay * fs - whole
    carry = np.exp(poles * step)
    old = _held(poles, step, part * step) * np.exp(poles * (1 - part) * step)
    new = _held(poles, step, (1 - part) * step)
    x = np.zeros(poles.size, complex)
    u, y = np.zeros(reference.size), np.zeros(reference.size)
    total = 0.0
    for k in range(reference.size):
        y[k] = float((residues @ x).real) + system.bias + noise[k]
        if k:
            error = reference[k - 1] - (y[k - 1] - system.bias)
            total += error
            u[k] = controller.proportional * error + controller.integral * total
        a = u[k - whole - 1] if k > whole else 0.0
        b = u[k - whole] if k >= whole else 0.0
        x = carry * x + old * a + new * b
    return u, y


def _held(poles: np.ndarray, step: float, span: float) -> np.ndarray:
    """Integral of e^(p s) over a span."""
    safe = np.where(poles == 0, 1.0, poles)
    return np.where(poles == 0, span, np.expm1(safe * span) / safe)
