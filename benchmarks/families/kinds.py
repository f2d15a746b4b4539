"""Systems and inputs drawn at random: what a family is put together from."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.signal import besselap, buttap
from scipy.special import expit

import hmpim
from families.drive import Drive, Lines, Samples
from families.system import System

Rng = np.random.Generator
MakeSystem = Callable[[Rng, Drive], System]
MakeDrive = Callable[[Rng], Drive]

RATES = (100.0, 200.0, 500.0, 1000.0)
LENGTHS = [600, 3000]
"""Samples of a record, unless the family is about its length; `--samples` sets both."""


def set_samples(samples: int | None) -> None:
    """Draw records of so many samples from now on, in this process; as ever if None."""
    LENGTHS[:] = [samples, samples] if samples else [600, 3000]


def log_uniform(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def length(rng: Rng) -> int:
    return int(log_uniform(rng, *LENGTHS) + 1e-6)  # exp(log n) may round below n


# --- systems -----------------------------------------------------------------------------------


def around(rng: Rng, drive: Drive, **dynamics: object) -> System:
    """Dynamics with a delay, a gain of either sign and a bias drawn at random."""
    gain = float(rng.choice([-1.0, 1.0])) * log_uniform(rng, 0.3, 3.0)
    delay = log_uniform(rng, 0.4, 40.0) / drive.fs
    bias = float(rng.uniform(-1, 1)) * abs(gain)
    return System(**{"delay": delay, "gain": gain, "bias": bias} | dynamics)


def share_of(rng: Rng, drive: Drive, low: float, high: float) -> float:
    """A frequency between two shares of the excited band's end."""
    return drive.band[1] * log_uniform(rng, low, high)


def static(rng: Rng, drive: Drive) -> System:
    return around(rng, drive)


def first_order(rng: Rng, drive: Drive) -> System:
    return around(rng, drive, lags=(0.159 / share_of(rng, drive, 0.08, 0.6),))


def second_order(low: float = 0.15, high: float = 1.4) -> MakeSystem:
    def make(rng: Rng, drive: Drive) -> System:
        damping = log_uniform(rng, low, high)
        damping += 0.03 if abs(damping - 1) < 0.02 else 0.0
        return around(rng, drive, pairs=((share_of(rng, drive, 0.12, 0.6), damping),))

    return make


def low_pass(kind: str) -> MakeSystem:
    """Butterworth or Bessel of order 2 to 6."""

    def make(rng: Rng, drive: Drive) -> System:
        order = int(rng.integers(2, 7))
        poles = (buttap if kind == "butterworth" else besselap)(order)[1]
        corner = share_of(rng, drive, 0.2, 0.6)
        pairs = tuple((corner * abs(p), -p.real / abs(p)) for p in poles if p.imag > 1e-9)
        lags = tuple(0.15915494 / (corner * abs(p)) for p in poles if abs(p.imag) <= 1e-9)
        return around(rng, drive, pairs=pairs, lags=lags)

    return make


def lead(rng: Rng, drive: Drive) -> System:
    """A zero below its pole."""
    pole = share_of(rng, drive, 0.2, 0.6)
    zero = pole * rng.uniform(0.15, 0.6)
    return around(rng, drive, lags=(0.159 / pole,), leads=(0.159 / zero,))


def lead_lag(rng: Rng, drive: Drive) -> System:
    slow = share_of(rng, drive, 0.04, 0.1)
    lags = (0.159 / slow, 0.159 / (slow * rng.uniform(4, 8)))
    leads = (0.159 / (slow * rng.uniform(1.5, 2.0)), 0.159 / (slow * rng.uniform(2.5, 3.5)))
    return around(rng, drive, lags=lags, leads=leads)


def slow_tail(rng: Rng, drive: Drive) -> System:
    """Second order; the last 1 to 6 % settles slowly, as in a loop with integral action."""
    pair = (share_of(rng, drive, 0.15, 0.5), float(rng.uniform(0.3, 0.9)))
    slow = drive.duration * log_uniform(rng, 0.03, 0.2)
    lead = slow * (1 + float(rng.choice([-1.0, 1.0])) * log_uniform(rng, 0.01, 0.06))
    return around(rng, drive, pairs=(pair,), lags=(slow,), leads=(lead,))


def non_minimum_phase(rng: Rng, drive: Drive) -> System:
    natural = share_of(rng, drive, 0.15, 0.5)
    zero = -0.159 / (natural * rng.uniform(0.7, 3))
    return around(rng, drive, pairs=((natural, rng.uniform(0.3, 0.9)),), leads=(zero,))


def with_zero(rng: Rng, drive: Drive) -> System:
    natural = share_of(rng, drive, 0.15, 0.5)
    zero = 0.159 / (natural * rng.uniform(0.4, 3))
    return around(rng, drive, pairs=((natural, rng.uniform(0.2, 0.9)),), leads=(zero,))


def notch(rng: Rng, drive: Drive) -> System:
    place = share_of(rng, drive, 0.15, 0.5)
    return around(
        rng,
        drive,
        pairs=((place, rng.uniform(0.3, 0.9)),),
        zero_pairs=((place * rng.uniform(0.97, 1.03), rng.uniform(0.03, 0.15)),),
    )


def anti_resonance(rng: Rng, drive: Drive) -> System:
    """Two modes with a dip between them, as of a load on a shaft."""
    low = share_of(rng, drive, 0.12, 0.25)
    dip, high = low * rng.uniform(1.3, 1.7), low * rng.uniform(2.0, 2.8)
    return around(
        rng,
        drive,
        pairs=((low, rng.uniform(0.05, 0.3)), (high, rng.uniform(0.05, 0.3))),
        zero_pairs=((dip, rng.uniform(0.03, 0.15)),),
    )


def modes(low: int, high: int) -> MakeSystem:
    """Several modes in parallel, spread over the band."""

    def make(rng: Rng, drive: Drive) -> System:
        count = int(rng.integers(low, high + 1))
        edges = np.geomspace(0.1, 0.8, count + 1) * drive.band[1]
        parts = []
        for a, b in itertools.pairwise(edges):
            share = float(rng.uniform(0.2, 0.8))
            place = a ** (1 - share) * b**share
            size = log_uniform(rng, 0.2, 1.0) * (1.0 if rng.uniform() < 0.75 else -1.0)
            parts.append((size, place, float(rng.uniform(0.02, 0.1))))
        parts[0] = (1.0, *parts[0][1:])
        plain = around(rng, drive)
        scaled = tuple((plain.gain * g, f, z) for g, f, z in parts)
        return System(delay=plain.delay, bias=plain.bias, modes=scaled)

    return make


def integrator(rng: Rng, drive: Drive) -> System:
    return around(rng, drive, integrators=1)


def lagging_integrator(rng: Rng, drive: Drive) -> System:
    return around(rng, drive, integrators=1, lags=(0.159 / share_of(rng, drive, 0.1, 0.5),))


def washout(rng: Rng, drive: Drive) -> System:
    """Zero at DC, one at high frequencies."""
    lag = 0.159 / (drive.band[0] * log_uniform(rng, 1.5, 12.0))
    return around(rng, drive, lags=(lag,), washouts=1, gain=lag * log_uniform(rng, 0.3, 3.0))


def ac_coupled(rng: Rng, drive: Drive) -> System:
    """A second-order sensor behind a capacitor."""
    slow = 0.159 / (drive.band[0] * log_uniform(rng, 1.0, 6.0))
    pair = (share_of(rng, drive, 0.2, 0.6), float(rng.uniform(0.2, 0.9)))
    gain = slow * log_uniform(rng, 0.3, 3.0)
    return around(rng, drive, pairs=(pair,), lags=(slow,), washouts=1, gain=gain)


def geophone(rng: Rng, drive: Drive) -> System:
    """Velocity to voltage: a second-order high pass, its corner within the band."""
    natural = drive.band[0] * log_uniform(rng, 2.0, 10.0)
    gain = log_uniform(rng, 0.3, 3.0) / (2 * np.pi * natural) ** 2
    return around(
        rng, drive, pairs=((natural, float(rng.uniform(0.3, 0.9))),), washouts=2, gain=gain
    )


def differentiator(rng: Rng, drive: Drive) -> System:
    """A rate sensor on a position command, with its own second-order lag."""
    pair = (share_of(rng, drive, 0.4, 0.8), float(rng.uniform(0.4, 0.9)))
    return around(rng, drive, pairs=(pair,), washouts=1)


def lag_behind_resonance(rng: Rng, drive: Drive) -> System:
    natural = share_of(rng, drive, 0.15, 0.5)
    lag = 0.159 / (natural * rng.uniform(0.25, 2.0))
    return around(rng, drive, pairs=((natural, log_uniform(rng, 0.05, 0.4)),), lags=(lag,))


def servo(zeros: int) -> MakeSystem:
    """A mode, a lag and one or two zeros, as of velocity and acceleration commands."""

    def make(rng: Rng, drive: Drive) -> System:
        natural = share_of(rng, drive, 0.15, 0.5)
        lag = 0.159 / (natural * rng.uniform(1.5, 6.0))
        leads = tuple(0.159 / (natural * rng.uniform(*span)) for span in _ZEROS[:zeros])
        pair = (natural, float(rng.uniform(0.4, 0.9)))
        return around(rng, drive, pairs=(pair,), lags=(lag,), leads=leads)

    return make


_ZEROS = ((0.5, 1.5), (1.8, 4.0))
"""Frequencies of a servo's zeros, over that of its mode."""


# --- inputs --------------------------------------------------------------------------------------


@lru_cache(maxsize=32)
def _designed(kind: str, variant: int) -> hmpim.Stimulus:
    """A stimulus of the package over 10 s; played faster or slower for other lengths."""
    band = ((0.1, 20.0), (0.1, 10.0), (0.3, 30.0))[variant]
    limits = hmpim.Limits(position=1.0, velocity=150.0, acceleration=30_000.0)
    seed = variant if kind == "random_phase" else None
    return hmpim.design(band=band, duration=10.0, fs=200.0, limits=limits, kind=kind, rng=seed)


def designed(kind: str, between: str = "smooth") -> MakeDrive:
    """One of the package's own stimuli, as a function of time and nothing else."""

    def make(rng: Rng) -> Drive:
        stimulus = _designed(kind, int(rng.integers(3)))
        top = stimulus.band[1] if stimulus.band else 20.0
        fs = float(rng.choice(RATES))
        count = int(stimulus.samples * rng.uniform(1.0, 1.4))  # as finely as designed, or finer
        pace = stimulus.time[-1] * fs / count
        top = top * pace
        amplitude = log_uniform(rng, 0.5, 20.0)

        def source(time: np.ndarray) -> np.ndarray:
            return amplitude * stimulus.waveform.motion(time * pace).position

        low = stimulus.band[0] * pace if stimulus.band else 0.1 * pace
        return Drive(source=source, between=between, band=(low, top), fs=fs, samples=count)

    return make


def sweep(
    between: str = "smooth",
    *,
    rates: tuple[float, ...] = RATES,
    extinction: tuple[float, ...] = (0.0, 0.5, 1.0),
    samples: int | None = None,
    high: float = 0.35,
) -> MakeDrive:
    """The paper's sweep as printed, or the plain chirp (n = 0), in closed form.

    It ends at 0.05 to `high` of the rate.
    """

    def make(rng: Rng) -> Drive:
        fs = float(rng.choice(rates))
        count = samples or length(rng)
        seconds = count / fs
        low, top = 1 / seconds, fs * float(rng.uniform(0.05, high))
        n, amplitude = float(rng.choice(extinction)), log_uniform(rng, 0.5, 20.0)
        return Drive(
            source=_swept(low, top, seconds, n, amplitude),
            between=between,
            band=(low, top),
            fs=fs,
            samples=count,
        )

    return make


def sweep_to(rng: Rng, fs: float, samples: int, top: float) -> Drive:
    """A plain sweep to a stated frequency."""
    low, amplitude = fs / samples, log_uniform(rng, 0.5, 20.0)
    low = min(low, 0.2 * top)
    source = _swept(low, top, samples / fs, 0.0, amplitude)
    return Drive(source=source, between="smooth", band=(low, top), fs=fs, samples=samples)


def _swept(low: float, high: float, seconds: float, n: float, amplitude: float):
    a, b = 2 * np.pi * (high - low) / seconds, 2 * np.pi * low
    grid = np.linspace(0, seconds, 4000)
    height = np.max(np.abs(np.sin(b * grid + a / 2 * grid**2) / (b + a / 2 * grid**n)))

    def source(time: np.ndarray) -> np.ndarray:
        t = np.clip(time, 0.0, None)  # goes on beyond its end, for a record that ends before it
        shape = np.sin(b * t + a / 2 * t * np.minimum(t, seconds)) / (b + a / 2 * t**n)
        return amplitude / height * np.where(time > 0, shape, 0.0)

    return source


def sequence(
    kind: str,
    between: str = "zoh",
    *,
    rates: tuple[float, ...] = RATES,
    quiet: bool = True,
    samples: int | None = None,
) -> MakeDrive:
    """White, or a binary sequence clocked at the rate or slower, as a computer sends it."""

    def make(rng: Rng) -> Drive:
        fs = float(rng.choice(rates))
        count = samples or length(rng)
        amplitude = log_uniform(rng, 0.5, 20.0)
        before = 0 if quiet else count // 2
        total = before + count + 200
        slow = int(rng.integers(2, 7)) if kind == "prbs" else 1  # 'fast_prbs': at the rate
        if kind == "white":
            values = rng.standard_normal(total)
        else:
            values = np.repeat(rng.choice([-1.0, 1.0], total // slow + 1), slow)[:total]
        values = amplitude * values
        if quiet:
            values[: int(0.02 * count)] = 0.0
        return Drive(
            source=Samples(values, fs, -before / fs),
            between=between,
            band=(2 * fs / count, 0.42 * fs / slow),
            fs=fs,
            samples=count,
            quiet=quiet,
        )

    return make


def lines(
    shape: str = "flat",
    *,
    rates: tuple[float, ...] = RATES,
    samples: int | None = None,
    periodic: bool = False,
) -> MakeDrive:
    """Band-limited noise ('flat'), what a hand does ('human'), or a Schroeder period.

    It moves before the record begins; with `periodic`, the record is one or more whole periods.
    """

    def make(rng: Rng) -> Drive:
        fs = float(rng.choice(rates))
        count = samples or length(rng)
        repeats = int(rng.integers(1, 4)) if periodic else 1
        period = count // repeats if periodic else 2 * count + int(rng.integers(97))
        count = period * repeats if periodic else count
        f = np.fft.rfftfreq(period, 1 / fs)
        high = fs * float(rng.uniform(0.1, 0.35)) if shape != "human" else float(rng.uniform(1, 3))
        size = ((f > 0) & (f <= high)).astype(float)
        if shape == "human":
            size = (f > 0) / (1 + (f / high) ** 4)
        k = np.arange(f.size)
        angle = rng.uniform(0, 2 * np.pi, f.size)
        if shape == "schroeder":
            angle = -np.pi * k * (k - 1) / max(size.sum(), 1)
        spectrum = size * np.exp(1j * angle)
        spectrum *= log_uniform(rng, 0.5, 20.0) / np.fft.irfft(spectrum, period).std()
        return Drive(
            source=Lines(spectrum, fs, period),
            between="smooth",
            band=(max(1 / period * fs, 0.05), high if shape != "human" else 2 * high),
            fs=fs,
            samples=count,
            quiet=False,
        )

    return make


def shaped(
    kind: str,
    between: str = "zoh",
    *,
    rates: tuple[float, ...] = RATES,
) -> MakeDrive:
    """Step, doublet, 3-2-1-1 or ramp; the system's speed goes with the pulse's length."""

    def make(rng: Rng) -> Drive:
        fs = float(rng.choice(rates))
        count = length(rng)
        begin = int(count * rng.uniform(0.05, 0.15))
        unit = max(int(count * rng.uniform(0.02, 0.05)), 3)
        amplitude = log_uniform(rng, 0.5, 20.0)
        values = np.zeros(count + 400)
        pieces = {
            "step": ((values.size, 1.0),),
            "doublet": ((2 * unit, 1.0), (2 * unit, -1.0)),
            "3211": ((3 * unit, 1.0), (2 * unit, -1.0), (unit, 1.0), (unit, -1.0)),
        }
        place = begin
        for size, level in pieces.get(kind, ()):
            values[place : place + size] = level
            place += size
        if kind == "ramp":
            rise = 6 * unit
            values[begin:] = np.minimum(np.arange(values.size - begin) / rise, 1.0)
        top = 1.5 / unit
        return Drive(
            source=Samples(amplitude * values, fs),
            between=between,
            band=(2 * fs / count, top * fs),
            fs=fs,
            samples=count,
        )

    return make


def sines(count_of_lines: int) -> MakeDrive:
    """One line, or a few, already going when the record begins."""

    def make(rng: Rng) -> Drive:
        fs = float(rng.choice(RATES))
        count = length(rng)
        places = np.sort(fs * np.exp(rng.uniform(np.log(0.01), np.log(0.1), count_of_lines)))
        angles = rng.uniform(0, 2 * np.pi, count_of_lines)
        amplitude = log_uniform(rng, 0.5, 20.0)

        def source(time: np.ndarray) -> np.ndarray:
            turns = 2 * np.pi * places[:, None] * time + angles[:, None]
            return amplitude * np.sin(turns).sum(axis=0)

        band = (0.98 * float(places[0]), 1.02 * float(places[-1]))
        return Drive(source=source, between="smooth", band=band, fs=fs, samples=count, quiet=False)

    return make


def impact(rng: Rng) -> Drive:
    """One blow of a hammer, a few samples wide."""
    fs, count = float(rng.choice(RATES)), length(rng)
    at, width = float(rng.uniform(0.03, 0.1)) * count / fs, float(rng.uniform(1.5, 4)) / fs
    amplitude = log_uniform(rng, 5.0, 200.0)

    def source(time: np.ndarray) -> np.ndarray:
        return amplitude * np.exp(-0.5 * ((time - at) / width) ** 2)

    band = (2 * fs / count, 0.32 / width)
    return Drive(source=source, between="smooth", band=band, fs=fs, samples=count)


def after_a_step(make: MakeDrive) -> MakeDrive:
    """The same input, begun while the output still rings from a step to where it starts."""

    def made(rng: Rng) -> Drive:
        drive = make(rng)
        size = float(rng.uniform(0.5, 2)) * float(np.max(np.abs(drive.sampled())))
        edge = 2.0 / drive.fs
        before = float(rng.uniform(0.1, 0.5)) / drive.band[1] * 2 + 6 * edge

        def source(time: np.ndarray) -> np.ndarray:
            return drive.source(time) + size * expit((time + before) / (0.5 * edge))

        return replace(drive, source=source, quiet=False)

    return made


def faded(make: MakeDrive, share: float = 0.1) -> MakeDrive:
    """The same input from rest to rest: it fades in and out over a share of the record."""

    def made(rng: Rng) -> Drive:
        drive = make(rng)
        edge, last = share * drive.duration, (drive.samples - 1) / drive.fs

        def source(time: np.ndarray) -> np.ndarray:
            inside = np.clip(np.minimum(time, last - time) / edge, 0.0, 1.0)
            return drive.source(time) * np.sin(0.5 * np.pi * inside) ** 4

        return replace(drive, source=source)

    return made


def slower_clock(make: MakeDrive, low: int = 2, high: int = 5) -> MakeDrive:
    """Sent through a converter that is slower than the record's clock."""

    def made(rng: Rng) -> Drive:
        drive = make(rng)
        every = int(rng.integers(low, high + 1))
        top = min(drive.band[1], 0.4 * drive.fs / every)
        return replace(drive, between="zoh", every=every, band=(drive.band[0], top))

    return made
