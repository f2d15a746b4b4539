"""Linear systems by their poles: response, modal form, and every figure that has a true value."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

__all__ = ["Modal", "System", "figures"]

Pairs = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Modal:
    """Sum of r / (s - p) and a direct term; poles in rad/s, all of a conjugate pair."""

    poles: np.ndarray
    residues: np.ndarray
    direct: float


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """Delay, gain and bias around dynamics of any order.

    Parameters
    ----------
    delay, gain, bias : float
        Seconds; gain of what is left when zeros and poles at DC are taken out; output unit.
    pairs, zero_pairs : tuple of (Hz, damping ratio)
        Second-order sections of the denominator and of the numerator.
    lags, leads : tuple of float
        Time constants in s of first-order sections, below and above; a lead below 0 lies in
        the right half plane.
    integrators, washouts : int
        Poles and zeros at DC.
    modes : tuple of (gain, Hz, damping ratio)
        In parallel; then there are no other sections.
    """

    delay: float = 0.0
    gain: float = 1.0
    bias: float = 0.0
    pairs: Pairs = ()
    zero_pairs: Pairs = ()
    lags: tuple[float, ...] = ()
    leads: tuple[float, ...] = ()
    integrators: int = 0
    washouts: int = 0
    modes: tuple[tuple[float, float, float], ...] = ()

    def vector(self) -> np.ndarray:
        """Every number that the record must tell, bias last."""
        if self.modes:
            return np.array([self.delay, *(v for m in self.modes for v in m), self.bias])
        sections = [v for pair in (*self.pairs, *self.zero_pairs) for v in pair]
        return np.array([self.delay, self.gain, *sections, *self.lags, *self.leads, self.bias])

    def moved(self, vector: np.ndarray) -> System:
        """The same system with other numbers."""
        v = [float(x) for x in vector]
        if self.modes:
            modes = tuple((v[i], v[i + 1], v[i + 2]) for i in range(1, len(v) - 1, 3))
            return replace(self, delay=v[0], modes=modes, bias=v[-1])
        rest = iter(v[2:-1])
        return replace(
            self,
            delay=v[0],
            gain=v[1],
            pairs=tuple((next(rest), next(rest)) for _ in self.pairs),
            zero_pairs=tuple((next(rest), next(rest)) for _ in self.zero_pairs),
            lags=tuple(next(rest) for _ in self.lags),
            leads=tuple(next(rest) for _ in self.leads),
            bias=v[-1],
        )

    @property
    def steady(self) -> bool:
        """Whether there is a gain at DC, neither 0 nor infinite."""
        return not (self.integrators or self.washouts)

    @property
    def dynamic(self) -> bool:
        return bool(self.pairs or self.lags or self.modes)

    @property
    def scale_factor(self) -> float:
        return self.gain * sum(m[0] for m in self.modes) if self.modes else self.gain

    def poles(self) -> np.ndarray:
        pairs = tuple((f, z) for _, f, z in self.modes) or self.pairs
        below = [root for f, z in pairs for root in _pair(f, z)]
        return np.array(
            [*below, *(-1.0 / t for t in self.lags), *([0.0] * self.integrators)], complex
        )

    def modal(self) -> Modal:
        """Partial fractions; poles must be distinct."""
        poles = self.poles()
        if self.modes:
            residues = [
                self.gain * g * (2 * np.pi * f) ** 2 / np.array([a - b, b - a])
                for g, f, z in self.modes
                for a, b in [_pair(f, z)]
            ]
            return Modal(poles=poles, residues=np.concatenate(residues), direct=0.0)
        zeros = [root for f, z in self.zero_pairs for root in _pair(f, z)]
        zeros = np.array(
            [*zeros, *(-1.0 / t for t in self.leads), *([0.0] * self.washouts)], complex
        )
        if zeros.size > poles.size:
            raise ValueError(f"{zeros.size} zeros over {poles.size} poles cannot be simulated")
        top = self.gain * np.prod(self.leads) / np.prod(self.lags)
        top *= np.prod([(2 * np.pi * f) ** 2 for f, _ in self.pairs])
        top /= np.prod([(2 * np.pi * f) ** 2 for f, _ in self.zero_pairs])
        residues = np.empty(poles.size, complex)
        for k, p in enumerate(poles):
            residues[k] = top * np.prod(p - zeros) / np.prod(p - np.delete(poles, k))
        direct = float(top) if zeros.size == poles.size else 0.0
        return Modal(poles=poles, residues=residues, direct=direct)

    def response(self, frequency: np.ndarray, *, delay: bool = True) -> np.ndarray:
        """Complex response at frequencies in Hz."""
        f = np.asarray(frequency, float)
        s = 2j * np.pi * f
        if self.modes:
            value = sum(g * _section(f, fn, z) for g, fn, z in self.modes) * self.gain
        else:
            value = np.full(f.shape, self.gain, complex)
            for fn, z in self.pairs:
                value = value * _section(f, fn, z)
            for fn, z in self.zero_pairs:
                value = value / _section(f, fn, z)
            for t in self.lags:
                value = value / (1 + s * t)
            for t in self.leads:
                value = value * (1 + s * t)
            value = value * s ** (self.washouts - self.integrators)
        return value * np.exp(-s * self.delay) if delay else value


def _pair(frequency: float, damping: float) -> tuple[complex, complex]:
    omega = 2 * np.pi * frequency
    half = np.sqrt(complex(damping**2 - 1))
    return omega * (-damping - half), omega * (-damping + half)


def _section(f: np.ndarray, natural: float, damping: float) -> np.ndarray:
    x = f / natural
    return 1.0 / (1 - x * x + 2j * damping * x)


_POINTS = 1500


def figures(system: System, *, top: float) -> dict[str, float]:
    """Every figure of the result that has a true value; frequencies up to `top` Hz.

    Those relative to DC are left out of systems that integrate or are zero there; the lowest
    mode where another is within a third of it.
    """
    found = {"delay": system.delay, "bias": system.bias}
    if not system.washouts:
        found["scale_factor"] = system.scale_factor
    mode = _lowest_mode(system)
    if mode is not None:
        found["natural_frequency"], found["damping_ratio"] = mode
    poles = system.poles()
    moving = poles[np.abs(poles) > 0]
    if moving.size:
        slowest = moving[np.argmax(moving.real)]
        if abs(slowest.imag) < 1e-9 * abs(slowest):
            found["time_constant"] = float(-1.0 / slowest.real)
    if system.steady:
        found |= _relative_to_dc(system, top)
    return found


def _lowest_mode(system: System) -> tuple[float, float] | None:
    pairs = sorted([(f, z) for _, f, z in system.modes] or list(system.pairs))
    if not pairs and len(system.lags) == 2:
        a, b = system.lags
        return 1 / (2 * np.pi * np.sqrt(a * b)), (a + b) / (2 * np.sqrt(a * b))
    if not pairs or (len(pairs) > 1 and pairs[1][0] < 1.33 * pairs[0][0]):
        return None
    return pairs[0]


def _slope_at_dc(system: System) -> float:
    """-d(phase)/dω at 0: delay and what the dynamics add."""
    if system.modes:
        total = sum(g for g, _, _ in system.modes)
        return system.delay + sum(g / total * z / (np.pi * f) for g, f, z in system.modes)
    late = system.delay + sum(system.lags) - sum(system.leads)
    late += sum(z / (np.pi * f) for f, z in system.pairs)
    return late - sum(z / (np.pi * f) for f, z in system.zero_pairs)


def _relative_to_dc(system: System, top: float) -> dict[str, float]:
    found = {"delay_low_frequency": _slope_at_dc(system)}
    marks = [f for f, z in system.pairs] + [f for _, f, z in system.modes]
    near = [f * np.linspace(0.8, 1.2, 400) for f in marks]
    grid = np.unique(np.concatenate([np.geomspace(top * 1e-4, top, _POINTS), *near]))
    grid = grid[grid <= top]
    own = system.response(grid, delay=False) / system.scale_factor
    turned = np.unwrap(np.angle(own))

    def refine(values: np.ndarray, function) -> float | None:
        below = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
        if not below.size:
            return None
        i = below[0]
        return brentq(function, grid[i], grid[i + 1], xtol=1e-12 * grid[i], rtol=1e-13)

    def margin(f: float, late: float) -> float:
        i = min(max(int(np.searchsorted(grid, f)), 0), grid.size - 1)
        value = np.angle(system.response(np.array([f]), delay=False)[0] / system.scale_factor)
        value += 2 * np.pi * np.round((turned[i] - value) / (2 * np.pi))
        return value - 2 * np.pi * f * late + np.pi / 2

    for name, late in (
        ("bandwidth_phase90", system.delay),
        ("bandwidth_phase90_without_delay", 0.0),
    ):
        if name == "bandwidth_phase90_without_delay" and not system.dynamic:
            continue
        place = refine(turned - 2 * np.pi * grid * late + np.pi / 2, lambda f, t=late: margin(f, t))
        if place is not None:
            found[name] = place
    if not system.dynamic:
        return found
    gain = np.abs(own)

    def half(f: float) -> float:
        return abs(system.response(np.array([f]))[0] / system.scale_factor) ** 2 - 0.5

    place = refine(gain**2 - 0.5, half)
    if place is not None:
        found["bandwidth_3db"] = place
    i = int(np.argmax(gain))
    found["peak_gain_db"] = 0.0
    if gain[i] > 1 and 0 < i < grid.size - 1:
        for _ in range(4):
            fine = np.linspace(grid[i - 1], grid[i + 1], 101)
            level = np.abs(system.response(fine) / system.scale_factor)
            j = min(max(int(np.argmax(level)), 1), 99)
            grid = np.concatenate([fine[j - 1 : j + 2]])
            gain, i = level[j - 1 : j + 2], 1
        hump = float(20 * np.log10(gain[1]))
        found["peak_gain_db"] = hump if hump > 1e-9 else 0.0  # less is rounding
    return found
