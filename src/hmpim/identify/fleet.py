"""Many records of one stimulus and of second order: fitted together, by what they share.

What a model of one structure can make of one stimulus is a surface of few dimensions in the space
of records. Over the box in which the units of a fleet lie it is sampled once: an orthonormal basis
of some ten to forty rows holds it, and a polynomial says where on it a model lies. Each output is
then one product with the basis, and all are fitted at once by the same least squares as
`hmpim.identify`, in a few numbers instead of thousands. The basis is the stimulus' transforms
and Gram matrix, made once for all.

The parameters and their errors are those of a fit to the record itself, as long as what the basis
and the polynomials are off is small beside a standard deviation: `FleetFit.sound` says where it is,
where the unit lies inside the box, and where the residual is white and does not follow the input.
All other records are for `identify`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.readings import read_figures
from hmpim.identify.result import Estimate, PairIdentification, Parameters
from hmpim.identify.surface import Surface, places_in
from hmpim.identify.uncertainty import noise_estimate
from hmpim.identify.whiteness import is_white, misfit
from hmpim.model.dynamics import STRUCTURES, Structure
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["Fleet", "FleetFit", "fit_fleet", "learn_fleet"]

Real = NDArray[np.float64]

_DEGREE = 9
_UNSEEN = 1e-9
"""Share of the greatest singular value below which a direction of the surface is left out."""

_OFF = 0.05
"""Error of the surface, in standard deviations of a parameter, that is let pass."""

_CLEAR = 100.0
"""By how much the criterion must prefer the structure, so that no other widens its bars."""

_WIDE = 4.5
"""Half a side of the box, in deviations of the units that it is learnt from."""

_CHANCE = 1e-3
"""Chance at which a record is taken as one whose residual follows the input."""

_STEPS = 12
_FEWEST = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fleet:
    """What records of one stimulus share.

    Parameters
    ----------
    u : ndarray, shape (n,)
        The stimulus.
    fs : float
        Rate in Hz.
    band : (float, float)
        Excited band in Hz.
    structure : Structure
        Of every unit.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What the stimulus does between its samples.
    basis : ndarray, shape (r, n)
        Orthonormal, each row without mean.
    surface : Surface
        Places in the basis, and the mean in the last column, of the unit-gain response; a function
        of the delay in samples and of the logarithms of ω and ζ.
    lost : float
        Largest root of the sum of squares of what the basis and the surface leave out.
    figures : Surface
        What is read off a model of unit gain, in the order of `names`.
    names : tuple of str
        Fields of `Parameters`.
    """

    u: Real
    fs: float
    band: tuple[float, float]
    structure: Structure
    intersample: Intersample
    basis: Real
    surface: Surface
    lost: float
    figures: Surface
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FleetFit:
    """Parameters of many records.

    Parameters
    ----------
    parameters : tuple of Parameters
        Of each record; without the paper's delay. Those of a record that is not sound are None.
    sound : ndarray of bool, shape (N,)
        Whether they are what `identify` would say.
    fit_percent : ndarray, shape (N,)
        100 (1 - ||y - ŷ|| / ||y - mean y||).
    """

    parameters: tuple[Parameters | None, ...]
    sound: NDArray[np.bool_]
    fit_percent: Real


def learn_fleet(
    u: Real, pairs: Sequence[PairIdentification], *, fs: float, band: tuple[float, float]
) -> Fleet | None:
    """Learn from some units what a fleet shares; None where they are not of one kind.

    Parameters
    ----------
    u : ndarray, shape (n,)
        The stimulus, common to all.
    pairs : sequence of PairIdentification
        What `identify` said of five or more units.
    fs : float
        Rate in Hz.
    band : (float, float)
        Excited band in Hz.
    """
    if len(pairs) < _FEWEST or not all(_is_plain(pair, pairs[0]) for pair in pairs):
        return None
    structure = STRUCTURES["second_order"]
    places = np.array([_place(pair, fs) for pair in pairs])
    middle = np.median(places, axis=0)
    spread = 1.4826 * np.median(np.abs(places - middle), axis=0)
    own = max(pair.delay.spread if pair.delay is not None else np.inf for pair in pairs) * fs
    least = np.concatenate([[max(3 * own, 0.02)], np.full(middle.size - 1, 0.005)])
    farthest = np.abs(places - middle).max(axis=0)
    reach = np.maximum(_WIDE * np.maximum(spread, least), 1.3 * farthest)
    low, high = middle - reach, middle + reach
    return _made(u, structure, pairs[0].intersample, low, high, fs=fs, band=band)


def _is_plain(pair: PairIdentification, first: PairIdentification) -> bool:
    """Whether nothing but its structure, clearly, is said of a unit, and the same as of another."""
    if pair.structure != "second_order":  # of a simpler one, a second pole is never clearly absent
        return False
    rivals = [c.criterion for c in pair.candidates if c.structure != pair.structure]
    chosen = next((c.criterion for c in pair.candidates if c.chosen), np.inf)
    return (
        (pair.structure, pair.intersample) == (first.structure, first.intersample)
        and pair.verdict == "ok"
        and all(w.severity == "info" for w in pair.warnings)
        and min(rivals, default=np.inf) - chosen > _CLEAR
        and pair.parameters.hold_period is None
        and pair.parameters.saturation_low is None
        and pair.parameters.saturation_high is None
        and pair.parameters.quantization_step is None
    )


def _place(pair: PairIdentification, fs: float) -> Real:
    """Where a unit lies: delay in samples, logarithms of ω and ζ."""
    assert pair.delay is not None
    second, first, unit = pair.denominator
    omega = float(np.sqrt(unit / second))
    zeta = first / unit * omega / 2
    return np.array([pair.delay.value * fs, np.log(omega / fs), np.log(zeta)])


def _theta(place: Real) -> Real:
    """Parameters of a fit at a place.

    ω and ζ move more independently of each other than the fit's own, so that a box is smaller.
    """
    omega, zeta = np.exp(place[1:])
    return np.array([place[0], np.log(2 * zeta / omega), 0.25 / zeta**2])


def _made(
    u: Real,
    structure: Structure,
    intersample: Intersample,
    low: Real,
    high: Real,
    *,
    fs: float,
    band: tuple[float, float],
) -> Fleet | None:
    places = places_in(low, high, _DEGREE)
    problem = Problem(
        source=prepare_input(u, intersample),
        y=np.zeros(u.size),
        valid=None,
        longest_delay=float(u.size),
    )
    rows = np.stack([Part(problem, structure, _theta(place)).rows[0] for place in places])
    means = rows.mean(axis=1, keepdims=True)
    centred = rows - means
    _, sizes, basis = np.linalg.svd(centred, full_matrices=False)
    basis = basis[sizes > _UNSEEN * sizes[0]]
    inside = centred @ basis.T
    left = np.linalg.norm(centred - inside @ basis, axis=1).max()
    surface = Surface.fitted(low, high, places, np.hstack([inside, means]), degree=_DEGREE)
    read = [_figures_at(_theta(place), structure, fs) for place in places]
    names = tuple(name for name in read[0] if name is not None)
    if any(tuple(r) != names for r in read):
        return None  # a figure that some units of the box have and others do not
    values = np.array([list(r.values()) for r in read])
    return Fleet(
        u=u,
        fs=fs,
        band=band,
        structure=structure,
        intersample=intersample,
        basis=basis,
        surface=surface,
        lost=float(left + np.linalg.norm(surface.error)),
        figures=Surface.fitted(low, high, places, values, degree=_DEGREE),
        names=names,
    )


def _figures_at(theta: Real, structure: Structure, fs: float) -> dict[str, float]:
    """What is read off the model of unit gain at a place, up to half the rate."""
    vector = np.concatenate([theta, [1.0, 0.0]])
    nothing = Estimate(value=0.0, std=0.0, ci95=None)
    parameters, _, _ = read_figures(
        structure,
        vector,
        np.zeros((vector.size, vector.size)),
        fs=fs,
        highest=fs / 2,
        effective=10.0,
        noise=nothing,
        units=("", ""),
    )
    own = ("scale_factor", "bias", "noise_std")
    found = {f.name: getattr(parameters, f.name) for f in fields(parameters) if f.name not in own}
    return {name: estimate.value for name, estimate in found.items() if estimate is not None}


def fit_fleet(fleet: Fleet, outputs: Real, *, units: tuple[str, str] = ("", "")) -> FleetFit:
    """Fit many outputs of one stimulus at once.

    Parameters
    ----------
    fleet : Fleet
        From `learn_fleet`.
    outputs : ndarray, shape (N, n)
        One output a row.
    units : (str, str)
        Of input and output.

    Returns
    -------
    FleetFit
    """
    n = fleet.u.size
    means = outputs.mean(axis=1)
    centred = outputs - means[:, None]
    z = centred @ fleet.basis.T
    power = np.einsum("ij,ij->i", centred, centred)
    outside = np.maximum(power - np.einsum("ij,ij->i", z, z), 0.0)
    theta = _descended(fleet, z, outside)
    value, slope = fleet.surface.at(theta)
    g, dg = value[:, :-1], slope[:, :, :-1]
    gain = np.einsum("ij,ij->i", z, g) / np.einsum("ij,ij->i", g, g)
    left = z - gain[:, None] * g
    cost = outside + np.einsum("ij,ij->i", left, left)
    size = theta.shape[1]
    freedom = n - size - 2
    variance = cost / freedom
    rows = np.concatenate([gain[:, None, None] * dg, g[:, None, :]], axis=1)
    gram = np.einsum("iaj,ibj->iab", rows, rows)
    inner = np.linalg.pinv(gram, rcond=1e-13, hermitian=True)
    # The bias is the mean less what the model makes of it; the mean's own error is apart.
    by_mean = -np.concatenate([gain[:, None] * slope[:, :, -1], value[:, -1:]], axis=1)
    bias = means - gain * value[:, -1]
    covariance = variance[:, None, None] * inner
    bias_variance = np.einsum("ia,iab,ib->i", by_mean, covariance, by_mean) + variance / n
    residual = centred - (gain[:, None] * g) @ fleet.basis
    sound = _sound(fleet, theta, gain, variance, residual)
    figures, steep = fleet.figures.at(theta)
    spread = np.einsum("iak,iab,ibk->ik", steep, covariance[:, :size, :size], steep)
    sound &= (fleet.figures.error <= _OFF * np.sqrt(np.maximum(spread, 0.0)) + 1e-12).all(axis=1)
    highest = min(fleet.band[1], fleet.fs / 2)
    if "natural_frequency" in fleet.names:  # beyond the band no peak is told
        sound &= figures[:, fleet.names.index("natural_frequency")] < highest
    half = float(stdtrit(freedom, 0.975))
    scale_error = np.sqrt(covariance[:, size, size])
    found: list[Parameters | None] = []
    for i in range(outputs.shape[0]):
        if not sound[i]:
            found.append(None)
            continue
        told = {
            name: _estimate(figures[i, k], np.sqrt(spread[i, k]), half, _UNITS.get(name, ""))
            for k, name in enumerate(fleet.names)
            if not name.startswith("bandwidth") or figures[i, k] <= highest
        }
        told["scale_factor"] = _estimate(gain[i], scale_error[i], half, _gain_unit(units))
        told["bias"] = _estimate(bias[i], np.sqrt(bias_variance[i]), half, units[1])
        told["noise_std"] = noise_estimate(
            float(cost[i]), freedom=freedom, share=1.0, unit=units[1]
        )
        found.append(Parameters(**told))
    return FleetFit(
        parameters=tuple(found),
        sound=sound,
        fit_percent=100.0 * (1.0 - np.sqrt(cost / np.maximum(power, np.finfo(float).tiny))),
    )


_UNITS = {
    "damping_ratio": "", "peak_gain_db": "dB", "natural_frequency": "Hz",
    "bandwidth_phase90": "Hz", "bandwidth_phase90_without_delay": "Hz", "bandwidth_3db": "Hz",
    "delay": "s", "delay_low_frequency": "s", "time_constant": "s",
}  # fmt: skip


def _gain_unit(units: tuple[str, str]) -> str:
    given, got = units
    if given == got:
        return ""
    return f"{got or '1'}/{given}" if given else got


def _estimate(value: float, std: float, half: float, unit: str) -> Estimate:
    ends = (float(value - half * std), float(value + half * std))
    return Estimate(value=float(value), std=float(std), ci95=ends, unit=unit)


def _descended(fleet: Fleet, z: Real, outside: Real) -> Real:
    """Gauss-Newton for all records at once, the gain solved exactly at each step."""
    low, high = fleet.surface.low, fleet.surface.high
    theta = np.tile((low + high) / 2, (z.shape[0], 1))
    step = np.zeros_like(theta)
    share = np.ones(z.shape[0])
    before, best = np.full(z.shape[0], np.inf), theta.copy()
    for _ in range(_STEPS):
        value, slope = fleet.surface.at(theta)
        g, dg = value[:, :-1], slope[:, :, :-1]
        square = np.einsum("ij,ij->i", g, g)
        gain = np.einsum("ij,ij->i", z, g) / square
        left = z - gain[:, None] * g
        cost = outside + np.einsum("ij,ij->i", left, left)
        better = cost < before
        best[better], before = theta[better], np.minimum(cost, before)
        rows = gain[:, None, None] * dg
        along = np.einsum("iaj,ij->ia", rows, g) / square[:, None]
        rows = rows - along[:, :, None] * g[:, None, :]
        moment = np.einsum("iaj,ij->ia", rows, left)
        gram = np.einsum("iaj,ibj->iab", rows, rows)
        gram += 1e-9 * np.einsum("iaa->ia", gram)[:, :, None] * np.eye(gram.shape[1])
        fresh = np.linalg.solve(gram, moment[:, :, None])[:, :, 0]
        step = np.where(better[:, None], fresh, step)
        share = np.where(better, 1.0, share / 4)
        gained = np.einsum("ia,ia->i", fresh, moment)
        if (gained < 1e-6 * cost / fleet.u.size).all():
            break
        theta = np.clip(best + share[:, None] * step, low, high)
    return best


def _sound(
    fleet: Fleet, theta: Real, gain: Real, variance: Real, residual: Real
) -> NDArray[np.bool_]:
    """Whether each record is what it was taken for, and the surface exact enough for it."""
    inside = fleet.surface.holds(theta)
    exact = np.abs(gain) * fleet.lost <= _OFF * np.sqrt(variance)
    sound = inside & exact & np.isfinite(theta).all(axis=1)
    band = (fleet.band[0] / fleet.fs, fleet.band[1] / fleet.fs)
    for i in np.flatnonzero(sound):
        left = residual[i]
        sound[i] = (
            is_white(left)
            and misfit(fleet.u, left, delay=float(theta[i, 0]), band=band).probability > _CHANCE
        )
    return np.asarray(sound)
