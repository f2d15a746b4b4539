"""Families whose records are not one linear system under an input: loops, software, …"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.signal import butter

from families import kinds as k
from families import loops, nonlinear, software
from families.drive import Drive, Samples
from families.noise import Noise, white
from families.simulate import linear_output
from families.system import System
from families.take import Draw, Figure, Response, Take, finish, shoot

Make = Callable[[np.random.Generator], Draw]
Bend = Callable[[np.random.Generator, System, Drive], np.ndarray]


# --- not linear --------------------------------------------------------------------------------


def bent(bend: Bend, system: k.MakeSystem, drive: k.MakeDrive) -> Make:
    """What is right: the linear part. Nothing need be told; what is called ok must be right."""

    def make(rng: np.random.Generator) -> Draw:
        signal = drive(rng)
        unit = system(rng, signal)
        clean = bend(rng, unit, signal)
        noise = white().scaled(float(np.std(clean)) * 10 ** (-float(rng.uniform(30, 60)) / 20))
        take = Take(
            rng=rng,
            system=unit,
            drive=signal,
            noise=noise,
            start=0.0,
            clean=clean,
            u=signal.sampled(),
            y=clean + noise.draw(clean.size, rng),
            telling=False,
            absent={"noise_std"},
        )
        return finish(take)

    return make


def slew(rng: np.random.Generator, system: System, drive: Drive) -> np.ndarray:
    """Its servo moves at half to nine tenths of the fastest speed asked."""
    u = nonlinear.finely(drive)
    most = float(rng.uniform(0.5, 0.9)) * float(np.max(np.abs(np.diff(u))))
    return nonlinear.through(system, drive, nonlinear.slew_limited(u, most))[:: nonlinear.FINE]


def dead(rng: np.random.Generator, system: System, drive: Drive) -> np.ndarray:
    """Nothing happens within 1 to 10 % of the largest command."""
    u = nonlinear.finely(drive)
    half = k.log_uniform(rng, 0.01, 0.1) * float(np.max(np.abs(u)))
    return nonlinear.through(system, drive, nonlinear.dead_zone(u, half))[:: nonlinear.FINE]


def loose(rng: np.random.Generator, system: System, drive: Drive) -> np.ndarray:
    """Play of 1 to 10 % of the output's largest motion, to either side."""
    largest = float(np.max(np.abs(linear_output(replace(system, bias=0.0), drive))))
    return nonlinear.backlash(system, drive, k.log_uniform(rng, 0.01, 0.1) * largest)


def rubbing(rng: np.random.Generator, system: System, drive: Drive) -> np.ndarray:
    """It stands within 0.5 to 5 % of the largest command."""
    band = k.log_uniform(rng, 0.005, 0.05) * float(np.max(np.abs(drive.sampled())))
    return nonlinear.friction(system, drive, band)


def hardening(rng: np.random.Generator, system: System, drive: Drive) -> np.ndarray:
    """The cubic force is 2 to 20 % of the linear one at the largest deflection; or -1 to -8 %."""
    plain = replace(system, bias=0.0, delay=0.0, gain=1.0)
    largest = float(np.max(np.abs(linear_output(plain, drive))))
    size = k.log_uniform(rng, 0.02, 0.2) * float(rng.choice([-0.4, 1.0]))
    return nonlinear.spring(system, drive, size / largest**2)


# --- loops -------------------------------------------------------------------------------------


def loop(colour: Callable[[np.random.Generator], Noise], *, reference: bool, biased: bool) -> Make:
    """A plant read from its loop.

    What is right: the plant. The bound counts what the reference moves. Where the noise that
    goes round spoils a direct reading (`biased`) and no reference is given, nothing need be
    told, and what is called ok must be right.
    """

    def make(rng: np.random.Generator) -> Draw:
        fs = float(rng.choice(k.RATES))
        count = int(rng.integers(1500, 3000))
        system = _plant(rng, fs)
        controller = loops.tuned(system, fs, share=float(rng.uniform(0.3, 0.5)))
        place, _ = loops.margin_of(system, fs)
        top = min(place, 0.3 * fs)
        sweep = replace(k.sweep_to(rng, fs, count, top), between="zoh")
        r = sweep.sampled()
        still = np.zeros(count)
        u_clean, y_clean = loops.closed(system, controller, r, still, fs)
        size = float(np.std(y_clean)) * k.log_uniform(rng, 0.05, 0.3)
        noise = colour(rng).scaled(size)
        added = noise.draw(count, rng)
        u, y = loops.closed(system, controller, r, added, fs)
        driven = Drive(
            source=Samples(u_clean, fs), between="zoh", band=(fs / count, top), fs=fs, samples=count
        )
        take = Take(
            rng=rng,
            system=system,
            drive=driven,
            noise=noise,
            start=0.0,
            clean=y - added,
            u=u,
            y=y,
            telling=reference or not biased,
            intersample="zoh",
            options={"reference": "r"} if reference else {},
            references={"r": r} if reference else {},
        )
        return finish(take)

    return make


def _plant(rng: np.random.Generator, fs: float) -> System:
    """A lag, a second-order lag or a lagging integrator with a delay of some samples."""
    corner = fs * k.log_uniform(rng, 0.01, 0.04)
    kind = int(rng.integers(3))
    gain = float(rng.choice([-1, 1])) * k.log_uniform(rng, 0.3, 3.0)
    delay = float(rng.uniform(0.2, 6.0)) / fs
    bias = float(rng.uniform(-1, 1)) * abs(gain)
    if kind == 0:
        return System(delay=delay, gain=gain, bias=bias, lags=(0.159 / corner,))
    if kind == 1:
        pair = (corner, float(rng.uniform(0.3, 0.9)))
        return System(delay=delay, gain=gain, bias=bias, pairs=(pair,))
    gain *= 2 * np.pi * corner
    return System(delay=delay, gain=gain, bias=bias, lags=(0.159 / corner / 2,), integrators=1)


def servo(rng: np.random.Generator) -> Draw:
    """Reference to output of a loop with a delay inside: no model here describes it exactly.

    What is right: gain, bandwidths and response.
    """
    fs, count = float(rng.choice(k.RATES)), int(rng.integers(1500, 3000))
    system = replace(_plant(rng, fs), bias=0.0)
    controller = loops.tuned(system, fs, share=float(rng.uniform(0.25, 0.45)))
    place, _ = loops.margin_of(system, fs)
    drive = replace(k.sweep_to(rng, fs, count, min(1.2 * place, 0.3 * fs)), between="zoh")
    r = drive.sampled()
    _, y = loops.closed(system, controller, r, np.zeros(count), fs)
    noise = white().scaled(float(np.std(y)) * 10 ** (-float(rng.uniform(30, 60)) / 20))
    pulse = np.eye(1, 20_000)[0]
    _, answer = loops.closed(system, controller, pulse, np.zeros(pulse.size), fs)

    def at(frequency: np.ndarray) -> np.ndarray:
        return _transform(answer, fs, frequency)

    def unheld(frequency: np.ndarray) -> np.ndarray:
        """As from a continuous reference: the hold's own lag and droop taken out."""
        hold = np.sinc(frequency / fs) * np.exp(-1j * np.pi * frequency / fs)
        return at(frequency) / hold

    gain = float(answer.sum())
    figures = {
        "scale_factor": Figure(
            value=gain, bound=np.inf, widest=np.inf, tolerance=0.02 * abs(gain), tellable=False
        )
    }
    grid = np.geomspace(max(drive.band[0], 2 * fs / count), drive.band[1], 40)
    response = Response(frequency=grid, value=unheld(grid), band=drive.band, at=unheld, sampled=at)
    return Draw(
        fs=fs,
        inputs={"u": (None, r)},
        outputs={"y": (None, y + noise.draw(count, rng))},
        figures=figures,
        response=response,
        intersample="zoh",
    )


def _transform(impulse: np.ndarray, fs: float, frequency: np.ndarray) -> np.ndarray:
    last = np.flatnonzero(np.abs(impulse) > 1e-9 * np.max(np.abs(impulse)))[-1] + 1
    t = np.arange(last) / fs
    return np.array(
        [impulse[:last] @ np.exp(-2j * np.pi * f * t) for f in np.atleast_1d(frequency)]
    )


# --- software ----------------------------------------------------------------------------------


def program(
    unit: Callable[[np.random.Generator], software.Filter],
    drive: k.MakeDrive,
    *,
    snr: tuple[float, float] | None = None,
    settled: bool = True,
) -> Make:
    """Software, sample over sample; without noise but rounding, unless `snr` (dB) is given.

    Under noise it is stated to be software; without, nothing is.
    """

    def make(rng: np.random.Generator) -> Draw:
        signal = drive(rng)
        u = signal.sampled()
        filter_ = unit(rng)
        y = filter_.run(u, settled=settled)
        std = 0.0
        if snr is not None:
            std = float(np.std(y)) * 10 ** (-float(rng.uniform(*snr)) / 20)
            y = y + std * rng.standard_normal(y.size)
        draw = _programmed(filter_, signal, u, y, std)
        return draw if std else replace(draw, options={})

    return make


def _programmed(
    unit: software.Filter, drive: Drive, u: np.ndarray, y: np.ndarray, std: float
) -> Draw:
    fs = drive.fs
    truth = software.figures_of(unit, fs)
    bounds = _software_bounds(unit, u, std, fs)
    figures = {}
    for name, value in truth.items():
        tolerance = 0.02 * abs(value)
        if name == "delay":
            tolerance = 0.05 / fs
        elif name == "bias":
            tolerance = 0.02 * float(np.std(y))
        bound = bounds.get(name, bounds["scale_factor"] / abs(unit.gain) * abs(value))
        inside = not name.startswith("bandwidth") or drive.band[0] <= value <= drive.band[1]
        figures[name] = Figure(
            value=value,
            bound=bound,
            widest=max(3 * 2 * 1.96 * bound, 0.1 * tolerance),
            tolerance=tolerance,
            tellable=inside and bound < tolerance,
        )

    def at(frequency: np.ndarray) -> np.ndarray:
        return unit.response(frequency, fs)

    none = np.empty(0)
    return Draw(
        fs=fs,
        inputs={"u": (None, u)},
        outputs={"y": (None, y)},
        figures=figures,
        response=Response(frequency=none, value=none + 0j, band=drive.band, at=at),
        options={"intersample": "sampled"},
    )


def _software_bounds(
    unit: software.Filter, u: np.ndarray, std: float, fs: float
) -> dict[str, float]:
    """Of gain and bias, all coefficients free; a whole number of samples is known exactly."""
    if std == 0:
        return {"delay": 0.0, "scale_factor": 0.0, "bias": 0.0}
    top, below = unit.top, unit.below
    base = np.concatenate([top, below[1:]])

    def output(v: np.ndarray) -> np.ndarray:
        here = software.Filter(
            top=v[: top.size], below=np.concatenate([[1.0], v[top.size :]]), late=unit.late
        )
        return here.run(u)

    step = 1e-6
    rows = [
        (output(base + step * e) - output(base - step * e)) / (2 * step) for e in np.eye(base.size)
    ]
    full = np.stack([*rows, np.ones(u.size)], axis=1) / std
    covariance = np.linalg.pinv(full.T @ full, rcond=1e-13, hermitian=True)
    slope = np.concatenate(
        [np.full(top.size, 1 / below.sum()), np.full(below.size - 1, -unit.gain / below.sum()), [0]]
    )
    return {
        "delay": 0.0,
        "scale_factor": float(np.sqrt(slope @ covariance @ slope)),
        "bias": float(np.sqrt(covariance[-1, -1])),
    }


def pure_delay(rng: np.random.Generator) -> software.Filter:
    gain = k.log_uniform(rng, 0.3, 3.0)
    return software.Filter(top=np.array([gain]), below=np.ones(1), late=int(rng.integers(0, 21)))


def low_pass(rng: np.random.Generator) -> software.Filter:
    order = int(rng.integers(1, 5))
    top, below = butter(order, float(rng.uniform(0.05, 0.3)))
    return software.Filter(top=top, below=below, late=int(rng.integers(0, 8)))


def tracker(rng: np.random.Generator) -> software.Filter:
    alpha = float(rng.uniform(0.1, 0.7))
    return software.alpha_beta(alpha, alpha**2 / (2 - alpha))


def smoother(rng: np.random.Generator) -> software.Filter:
    """A moving average, flat or triangular."""
    width = int(rng.integers(3, 13))
    shape = np.ones(width) if rng.uniform() < 0.5 else np.bartlett(width + 2)[1:-1]
    return software.Filter(top=shape / shape.sum(), below=np.ones(1))


def one_pole(rng: np.random.Generator) -> software.Filter:
    share = float(rng.uniform(0.03, 0.4))
    late = int(rng.integers(0, 10))
    return software.Filter(top=np.array([share]), below=np.array([1.0, share - 1.0]), late=late)


def any_filter(rng: np.random.Generator) -> software.Filter:
    """One of the filters here."""
    kinds = (pure_delay, one_pole, low_pass, tracker, smoother)
    return kinds[int(rng.integers(len(kinds)))](rng)


def several_rates(rng: np.random.Generator) -> Draw:
    """A task that runs at every so many samples, and its answer comes some ticks later."""
    drive = k.sweep(extinction=(0.0,))(rng)
    every, late = int(rng.integers(2, 9)), int(rng.integers(0, 15))
    gain, fs = k.log_uniform(rng, 0.3, 3.0), drive.fs
    u = drive.sampled()
    index = np.arange(u.size) - late
    y = gain * np.where(index >= 0, u[np.maximum(index - index % every, 0)], u[0])
    std = float(np.std(y)) * 10 ** (-float(rng.uniform(40, 80)) / 20)
    held = std * rng.standard_normal(u.size)
    y = y + held[np.maximum(index - index % every, 0)]
    bound = std / (float(np.std(y)) * np.sqrt(u.size / every)) * gain

    def figure(value: float, bound: float, tolerance: float) -> Figure:
        widest = max(3 * 2 * 1.96 * bound, 0.1 * tolerance)
        return Figure(value=value, bound=bound, widest=widest, tolerance=tolerance, tellable=True)

    figures = {
        "delay": figure(late / fs, 0.0, 0.05 / fs),
        "scale_factor": figure(gain, bound, 0.02 * gain),
        "bias": figure(0.0, bound / gain * float(np.std(y)), 0.02 * float(np.std(y))),
        "hold_period": figure(every / fs, 0.0, 0.02 * every / fs),
    }
    return Draw(
        fs=fs,
        inputs={"u": (None, u)},
        outputs={"y": (None, y)},
        figures=figures,
        response=None,
        options={"intersample": "sampled"},
    )


# --- other clocks ------------------------------------------------------------------------------


def held_output(rng: np.random.Generator) -> Draw:
    """A sensor that updates its output on a clock of its own, slower than the record's.

    What is right: the delay up to the update; `hold_period`.
    """
    drive = k.sweep(extinction=(0.0, 1.0))(rng)
    period = float(rng.uniform(2.2, 7.0)) / drive.fs
    drive = k.sweep_to(rng, drive.fs, drive.samples, min(drive.band[1], 0.3 / period))
    system = k.second_order()(rng, drive)
    phase = float(rng.uniform(0, period))
    time = np.arange(drive.samples) / drive.fs
    update = np.floor((time - phase) / period + 1e-9).astype(int)
    first, last = int(update[0]), int(update[-1])
    own = replace(drive, fs=1 / period, samples=last - first + 1)

    def simulate(unit: System) -> np.ndarray:
        return linear_output(unit, own, start=phase + first * period)[update - first]

    clean = simulate(system)
    noise = white().scaled(float(np.std(clean)) * 10 ** (-float(rng.uniform(25, 60)) / 20))
    y = clean + noise.draw(last - first + 1, rng)[update - first]
    fresh = np.diff(update, prepend=first - 1) > 0
    take = Take(
        rng=rng,
        system=system,
        drive=drive,
        noise=noise,
        start=0.0,
        clean=clean,
        u=drive.sampled(),
        y=y,
        valid=fresh,
        simulate=simulate,
        absent={"noise_std"},
    )
    take.extras["hold_period"] = Figure(
        value=period, bound=0.0, widest=np.inf, tolerance=0.02 * period, tellable=True
    )
    return finish(take)


def two_clocks(rng: np.random.Generator) -> Draw:
    """Input and output logged by two instruments, each at its own rate and phase."""
    drive = k.sweep()(rng)
    drive = k.sweep_to(rng, drive.fs, drive.samples, 0.2 * drive.fs)
    system = k.second_order()(rng, drive)
    rate = drive.fs * float(rng.uniform(0.6, 1.7))
    begin = float(rng.uniform(0, 1)) / rate
    own = replace(drive, fs=rate, samples=int((drive.duration - begin) * rate))

    def simulate(unit: System) -> np.ndarray:
        return linear_output(unit, own, start=begin)

    clean = simulate(system)
    noise = white().scaled(float(np.std(clean)) * 10 ** (-float(rng.uniform(25, 60)) / 20))
    u = drive.sampled()
    take = Take(
        rng=rng,
        system=system,
        drive=drive,
        noise=noise,
        start=0.0,
        clean=clean,
        u=u,
        y=clean + noise.draw(clean.size, rng),
        simulate=simulate,
        absent={"noise_std"},
        stamps=np.arange(u.size) / drive.fs,
        y_stamps=begin + np.arange(clean.size) / rate,
    )
    return finish(take)


# --- others ------------------------------------------------------------------------------------


def unrelated(rng: np.random.Generator) -> Draw:
    """Noise of some colour, or a slow drift, beside a sweep; nothing must be said of it."""
    drive = k.sweep()(rng)
    colour = [white(), Noise(parts=((1.0, 0.99, 0.0),)), Noise(parts=((1.0, 0.98, 0.3),))]
    y = colour[int(rng.integers(3))].draw(drive.samples, rng)
    return Draw(
        fs=drive.fs,
        inputs={"u": (None, drive.sampled())},
        outputs={"y": (None, y)},
        figures={},
        response=None,
        related=False,
    )


def in_units(system: k.MakeSystem, drive: k.MakeDrive) -> Make:
    """Both channels in a unit that is 10⁻¹⁰⁰ to 10¹⁰⁰ of the usual one."""

    def make(rng: np.random.Generator) -> Draw:
        signal = drive(rng)
        unit = system(rng, signal)
        plain = finish(shoot(rng, unit, signal, snr_db=float(rng.uniform(25, 60))))
        factor = 10.0 ** float(rng.uniform(-100, 100))
        figures = dict(plain.figures)
        for name in ("bias", "noise_std"):
            figures[name] = _times(figures[name], factor)
        return replace(
            plain,
            inputs={n: (t, v * factor) for n, (t, v) in plain.inputs.items()},
            outputs={n: (t, v * factor) for n, (t, v) in plain.outputs.items()},
            figures=figures,
        )

    return make


def _times(figure: Figure, factor: float) -> Figure:
    return replace(
        figure,
        value=figure.value * factor,
        bound=figure.bound * factor,
        widest=figure.widest * factor,
        tolerance=figure.tolerance * factor,
    )
