"""A record in the making: what is simulated, what spoils it, and what it can still tell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import get_args

import numpy as np

from families.bound import Information, derivatives, information, propagated, spread
from families.drive import Between, Drive, Samples
from families.noise import Noise, white
from families.simulate import linear_output
from families.system import System, figures

__all__ = ["Draw", "Figure", "Response", "Take", "finish", "shoot"]

SHARE = 0.02
"""Part of a figure within which it is never wrong."""
DELAY_SHARE = 0.05
"""The same for a delay, in samples."""
OPERATING_POINT = 100.0
"""A bias is held against the output's r.m.s. motion where that is larger, or this much smaller."""
PEAK = 20 * np.log10(1 + SHARE)
KNOWN = 0.01
"""Relative deviation of the response, at the bound, where 5 % off is five deviations."""
ALIKE = 12.0
"""Twice the log-likelihood (6, odds of 400) by which another assumption must be worse."""
FLOOR = 0.1
"""Of the tolerance: no interval need be narrower, however little noise there is."""
HULL = 0.5
"""Deviations by which the assumptions between the samples must part to count as a hull."""
_LONG = 20_000
"""Samples from which on they are always told apart, or the record says which holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A true value and what the record tells of it.

    `bound` is the Cramér-Rao deviation, `widest` the widest 95 % interval that still counts,
    `tolerance` the error that is never wrong. `hull` says that it depends on what the input
    does between its samples, which the record does not tell.
    """

    value: float
    bound: float
    widest: float
    tolerance: float
    tellable: bool
    hull: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """True response at frequencies (Hz) where the record can tell it; of held samples, too.

    `others` are the responses that explain the record as well under another assumption between
    the samples.
    """

    frequency: np.ndarray
    value: np.ndarray
    band: tuple[float, float]
    at: Callable[[np.ndarray], np.ndarray]
    sampled: Callable[[np.ndarray], np.ndarray] | None = None
    others: tuple[np.ndarray, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Draw:
    """One record with its truth.

    `inputs`, `outputs` and `references` hold name to (time stamps or None, values); `options`
    what `identify` could be told, if it accepts it; `oracle` by how many deviations of the
    bound the best linear estimator, which knows the truth, misses each number of the system.
    """

    fs: float
    inputs: dict[str, tuple[np.ndarray | None, np.ndarray]]
    outputs: dict[str, tuple[np.ndarray | None, np.ndarray]]
    figures: dict[str, Figure]
    response: Response | None
    intersample: str | None = None
    options: dict[str, str] = field(default_factory=dict)
    references: dict[str, tuple[np.ndarray | None, np.ndarray]] = field(default_factory=dict)
    related: bool = True
    oracle: np.ndarray | None = None


@dataclass(slots=True, kw_only=True, eq=False)
class Take:
    """What conditions work on; see `finish` for what becomes of it."""

    rng: np.random.Generator
    system: System
    drive: Drive
    noise: Noise
    start: float
    clean: np.ndarray
    u: np.ndarray
    y: np.ndarray
    valid: np.ndarray | None = None
    nuisances: list[np.ndarray] = field(default_factory=list)
    extras: dict[str, Figure] = field(default_factory=dict)
    absent: set[str] = field(default_factory=set)
    telling: bool = True
    stamps: np.ndarray | None = None
    rows: np.ndarray | None = None
    u_offset: float = 0.0
    intersample: str | None = None
    options: dict[str, str] = field(default_factory=dict)
    references: dict[str, np.ndarray] = field(default_factory=dict)
    others: dict[str, np.ndarray] = field(default_factory=dict)
    simulate: Callable[[System], np.ndarray] | None = None
    fed_forward: bool = False
    y_stamps: np.ndarray | None = None

    @property
    def time(self) -> np.ndarray:
        return self.start + np.arange(self.u.size) / self.drive.fs

    @property
    def motion(self) -> float:
        """R.m.s. of the output about its mean, without noise."""
        return float(np.std(self.clean))

    def lose(self, lost: np.ndarray) -> None:
        """Samples whose value says nothing any more."""
        self.valid = ~lost if self.valid is None else self.valid & ~lost


def shoot(
    rng: np.random.Generator,
    system: System,
    drive: Drive,
    *,
    snr_db: float,
    colour: Noise | None = None,
    start: float = 0.0,
) -> Take:
    """Simulate, and add noise; the ratio is of the output's motion to the noise, r.m.s."""
    clean = linear_output(system, drive, start=start)
    noise = (colour or white()).scaled(float(np.std(clean)) * 10 ** (-snr_db / 20))
    y = clean + noise.draw(clean.size, rng)
    u = drive.sampled(start)
    return Take(
        rng=rng, system=system, drive=drive, noise=noise, start=start, clean=clean, u=u, y=y
    )


def steps_of(system: System, drive: Drive) -> np.ndarray:
    """Steps for numerical derivatives: a part of a sample for the delay, relative otherwise."""
    vector = system.vector()
    steps = 1e-5 * np.maximum(np.abs(vector), 1e-6)
    steps[0] = 1e-3 / drive.fs
    steps[-1] = 1.0
    return steps


def _figures(system: System, take: Take) -> dict[str, float]:
    found = figures(system, top=take.drive.fs / 2)
    if take.u_offset and not system.washouts:  # which let no offset through
        found["bias"] = system.bias - system.scale_factor * take.u_offset
    return found


def _tolerance(name: str, value: float, take: Take) -> float:
    if name in ("delay", "delay_low_frequency"):
        return DELAY_SHARE / take.drive.fs
    if name == "bias":
        usual = abs(value) < OPERATING_POINT * take.motion
        return SHARE * max(abs(value) if usual else 0.0, take.motion)
    return PEAK if name == "peak_gain_db" else SHARE * abs(value)


def finish(take: Take) -> Draw:
    """The record, its truth, and what it can tell."""
    system, drive = take.system, take.drive
    vector, steps = system.vector(), steps_of(system, drive)

    def output(v: np.ndarray) -> np.ndarray:
        moved = system.moved(v)
        if take.simulate is not None:
            return take.simulate(moved)
        return linear_output(moved, drive, start=take.start)

    rows = derivatives(output, vector, steps)
    told = information(rows, take.noise, valid=take.valid, nuisances=take.nuisances)
    covariance = told.covariance

    def named(v: np.ndarray) -> dict[str, float]:
        return _figures(system.moved(v), take)

    truth = named(vector)
    deviations = propagated(named, vector, steps, covariance)
    rivals = _alternatives(take, told)
    others = [_figures(rival, take) for rival in rivals]
    found = {}
    inside = _inside_band(truth, take)
    for name, value in truth.items():
        if name in take.absent:
            continue
        std, tolerance = deviations[name], _tolerance(name, value, take)
        places = [value, *(o[name] for o in others if name in o)]
        apart = max(places) - min(places)
        widest = 3 * (apart + 2 * 1.96 * std)
        found[name] = Figure(
            value=value,
            bound=std,
            widest=max(widest, _floor(name, tolerance, std)),
            tolerance=tolerance,
            tellable=bool(take.telling and inside(name) and std < tolerance),
            hull=bool(apart > HULL * std),
        )
    if take.noise.is_white and "noise_std" not in take.absent:
        found["noise_std"] = _noise_figure(take, vector.size)
    found |= take.extras
    draw = _packed(take, found, _response(take, rivals, steps, covariance))
    moves = (told.gain @ (take.y - take.clean))[: vector.size]
    return replace(draw, oracle=moves / np.sqrt(np.diag(covariance)))


def _floor(name: str, tolerance: float, std: float) -> float:
    if name == "peak_gain_db" and std == 0:  # no hump: 0 dB is exact
        return tolerance
    return FLOOR * tolerance


def _noise_figure(take: Take, parameters: int) -> Figure:
    std = float(np.sqrt(take.noise.variance))
    count = take.y.size if take.valid is None else int(take.valid.sum())
    bound = std / np.sqrt(2 * max(count - parameters - 1, 1))
    return Figure(
        value=std,
        bound=bound,
        widest=3 * 2 * 1.96 * bound,
        tolerance=SHARE * std,
        tellable=bool(take.telling and bound < SHARE * std),
    )


def _inside_band(truth: dict[str, float], take: Take) -> Callable[[str], bool]:
    low, high = take.drive.band
    peak = figures(take.system, top=high).get("peak_gain_db")

    def inside(name: str) -> bool:
        if name.startswith("bandwidth"):
            return low <= truth[name] <= high
        return name != "peak_gain_db" or truth[name] == peak

    return inside


def _alternatives(take: Take, told: Information) -> list[System]:
    """The system under each other assumption between the samples that fits as well."""
    drive = take.drive
    linear = take.simulate is None or take.fed_forward
    known = take.intersample or drive.every > 1 or not linear
    if known or not take.telling or drive.samples > _LONG:
        return []
    vector = take.system.vector()
    found = []
    for between in get_args(Between):
        if between == drive.between and not take.fed_forward:
            continue
        here, left = vector, take.clean
        for _ in range(4):
            other = linear_output(take.system.moved(here), drive, start=take.start, between=between)
            left = take.clean - other
            here = _bounded(here + (told.gain @ left)[: vector.size], vector)
        left = left - told.rows @ (told.gain @ left)
        if float(left @ take.noise.solve(left[:, None], take.valid)[:, 0]) < ALIKE:
            found.append(take.system.moved(here))
    return found


def _bounded(here: np.ndarray, around: np.ndarray) -> np.ndarray:
    """No time constant, frequency or damping changes its sign or doubles on the way."""
    reach = 0.5 * np.abs(around)
    reach[0] = reach[-1] = np.inf
    return np.clip(here, around - reach, around + reach)


def _response(
    take: Take, rivals: list[System], steps: np.ndarray, covariance: np.ndarray
) -> Response:
    """The true response where 5 % is five deviations at the bound."""
    low, high = take.drive.band
    low = max(low, 1.0 / take.drive.duration)
    grid = np.geomspace(low, max(min(high, 0.45 * take.drive.fs), 1.01 * low), 60)
    system = take.system

    def at(frequency: np.ndarray) -> np.ndarray:
        return system.response(frequency)

    value = at(grid)
    slopes = derivatives(lambda v: system.moved(v).response(grid) / value, system.vector(), steps)
    known = np.array(
        [np.hypot(spread(s.real, covariance), spread(s.imag, covariance)) < KNOWN for s in slopes]
    )
    return Response(
        frequency=grid[known],
        value=value[known],
        band=(low, high),
        at=at,
        sampled=_sampled_response(take) if take.drive.between in ("zoh", "foh") else None,
        others=tuple(rival.response(grid[known]) for rival in rivals),
    )


def _sampled_response(take: Take) -> Callable[[np.ndarray], np.ndarray]:
    """Response from the samples of a held or linear input to those of the output."""
    system, fs = take.system, take.drive.fs
    impulse = Drive(
        source=Samples(np.array([0.0, 1.0, 0.0]), fs, -1 / fs),
        between=take.drive.between,
        band=take.drive.band,
        fs=fs,
        samples=1 + int(np.clip(take.drive.samples, 2, 20_000)),
    )
    moved = replace(system, bias=0.0, leads=() if take.fed_forward else system.leads)
    before = system.leads if take.fed_forward else ()
    ahead = int(np.ceil(max(-system.delay, 0.0) * fs)) + 2

    def at(frequency: np.ndarray) -> np.ndarray:
        h = linear_output(moved, impulse, start=-ahead / fs)
        for _ in range(system.integrators):  # its response does not end, but its steps do
            h = np.diff(h, prepend=0.0)
        time = (np.arange(h.size) - ahead) / fs
        behind = np.array([h @ np.exp(-2j * np.pi * f * time) for f in frequency])
        s = 2j * np.pi * np.asarray(frequency)
        behind = behind / (1.0 - np.exp(-s / fs)) ** system.integrators
        return behind * np.prod([1.0 + s * lead for lead in before], axis=0)

    return at


def _packed(take: Take, found: dict[str, Figure], response: Response) -> Draw:
    stamps = take.stamps
    rows = slice(None) if take.rows is None else take.rows
    if take.rows is not None and stamps is None:
        stamps = take.time

    def channel(values: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
        return (None if stamps is None else stamps[rows]), values[rows]

    seen = channel(take.y) if take.y_stamps is None else (take.y_stamps, take.y)
    return Draw(
        fs=take.drive.fs,
        inputs={name: channel(values) for name, values in {"u": take.u, **take.others}.items()},
        outputs={"y": seen},
        figures=found,
        response=response,
        intersample=take.intersample,
        options=take.options,
        references={name: channel(values) for name, values in take.references.items()},
    )
