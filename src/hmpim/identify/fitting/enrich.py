"""Richer structures, for a record that the plain ones do not explain.

They are tried only where what the best plain structure leaves over still follows the input and
is worth more than a small share of the output: every simulation pays for every pole, and with
enough samples the smallest imperfection of real hardware is "significant".
"""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.start import RoughResponse, starting_values
from hmpim.identify.worth import FEW
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName, theta_of

__all__ = [
    "INTEGRATING",
    "MODES",
    "PLAIN",
    "RICH",
    "Proposal",
    "integrator_starts",
    "members",
    "proposals",
    "without_fast",
]

PLAIN: tuple[StructureName, ...] = ("static", "first_order", "second_order")
RICH: tuple[StructureName, ...] = (
    "first_order_zero",
    "second_order_zero",
    "second_order_zeros",
    "third_order",
    "third_order_zeros",
    "fourth_order",
    "fifth_order",
    "sixth_order",
    "two_modes",
    "washout",
    "band_pass",
    "washout_second_order",
)
MODES: tuple[StructureName, ...] = tuple(
    name for name, structure in STRUCTURES.items() if structure.parallel
)
INTEGRATING: tuple[StructureName, ...] = (
    "integrator",
    "integrator_first_order",
    "integrator_second_order",
)

_DELAYS = 7
"""How many delays to start from, about that of the best fit so far."""

_PROMISING = 1e3
"""Squared error on the rough response, over the least, up to which a structure is promising."""

_REWEIGHTINGS = 6


def integrator_starts(rough: RoughResponse, structure: Structure) -> list[Real]:
    """Starts for an integrator: those of the rest of it, from the input's running sum.

    Parameters
    ----------
    rough : RoughResponse
        Of the output against the running sum of the input.
    structure : Structure
        An integrator, alone or with a lag.
    """
    rest = STRUCTURES[PLAIN[structure.order]]  # the plain one of each order
    return starting_values(rough, rest)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal:
    """A structure with zeros or more than two poles, and where to start it.

    Parameters
    ----------
    structure : Structure
        What to fit.
    starts : tuple of ndarray, shape (1 + order,)
        Delay in samples, parameters of the denominator's sections; the most promising first.
    error : float
        Of the best start on the rough response.
    """

    structure: Structure
    starts: tuple[Real, ...]
    error: float


def proposals(
    rough: RoughResponse,
    structures: list[Structure],
    fit: Fit,
    *,
    count: int = 3,
    all_of_them: bool = False,
) -> list[Proposal]:
    """Structures with zeros or more than two poles: those that the response allows, plainest first.

    Sanathanan and Koerner's iteration on the rough response, at several delays about that of
    the best fit so far; poles in the right half plane are mirrored.

    Parameters
    ----------
    rough : RoughResponse
        From `hmpim.identify.fitting.start.rough_response`.
    structures : list of Structure
        What may be fitted.
    fit : Fit
        The best fit so far.
    count : int
        At most so many starts each.
    all_of_them : bool
        Whether those too that the rough response gives no reason to try.
    """
    if not structures:
        return []
    reach = np.pi / rough.omega[-1]
    near = np.linspace(-1.5, 0.5, _DELAYS)
    late = np.linspace(0.75, 1.5, 4)  # a zero as fast as its pole leads
    scale = float(np.sqrt(rough.weight @ rough.omega**2 / rough.weight.sum()))
    s = np.asarray(1j * rough.omega / scale, dtype=np.complex128)
    out = []
    for structure in structures:
        found: list[tuple[float, Real]] = []
        turns = [*near, *late] if structure.zeros >= structure.order else near
        for delay in np.maximum(fit.delay + reach * np.asarray(turns), -1.0):
            target = rough.response * np.exp(1j * rough.omega * (delay - rough.lag))
            error, denominator = _reweighted(s, target, rough.weight, structure)
            coefficients = _sections(denominator, structure)
            if coefficients is None:
                continue
            powers = np.concatenate([np.arange(1, order + 1) for order in structure.sections])
            theta = theta_of(structure, coefficients / scale**powers)
            found.append((error, np.concatenate([[delay], theta])))
        found.sort(key=lambda item: item[0])
        starts = [theta for _, theta in found[:count]]
        if structure.dc_zeros == 0:
            starts = [_from_plain(rough, structure, fit), *starts[: count - 1]]
        error = found[0][0] if found else float("inf")
        out.append(Proposal(structure=structure, starts=tuple(starts), error=error))
    if not all_of_them:
        out = [proposal for proposal in out if proposal.error < (1 - FEW) * _error(rough, fit)]
    least = min((proposal.error for proposal in out), default=0.0)

    def rank(proposal: Proposal) -> tuple[bool, int]:
        return proposal.error > _PROMISING * least, proposal.structure.parameters

    return sorted(out, key=rank)


def without_fast(fit: Fit, structure: Structure) -> Real | None:
    """Start of a plainer structure: the slowest poles of a fit; what the others do is delay.

    Parameters
    ----------
    fit : Fit
        With as many poles, or more.
    structure : Structure
        The plainer one; its integrator, if the fit has none, stands for the slowest pole.

    Returns
    -------
    ndarray, shape (1 + order,), or None where pairs of poles do not divide so
    """
    whole = fit.denominator[fit.structure.integrators :]
    poles = sorted(np.roots(whole[::-1]), key=lambda p: (abs(p), p.imag))
    slow = poles[: structure.integrators - fit.structure.integrators]
    kept: list[complex] = []
    for pole in poles[len(slow) :]:
        if len(kept) + (1 if pole.imag == 0.0 else 2) <= structure.order and pole.imag >= 0.0:
            kept += [pole] if pole.imag == 0.0 else [pole, pole.conjugate()]
    denominator = np.real(np.polynomial.polynomial.polyfromroots(kept))
    if len(kept) < structure.order or denominator[0] == 0.0 or any(p.imag for p in slow):
        return None
    denominator = denominator / denominator[0]
    coefficients = _sections(denominator, structure)
    if coefficients is None:
        return None
    late = fit.delay + whole[1] + sum((1.0 / p).real for p in slow)
    late -= denominator[1] if kept else 0.0
    if structure.zeros == structure.dc_zeros:  # no zero of its own: what the fit's do is delay too
        first, second = (*fit.numerator, 0.0)[structure.dc_zeros : structure.dc_zeros + 2]
        late -= second / first if first else 0.0
    return np.concatenate([[late], theta_of(structure, coefficients)])


def _error(rough: RoughResponse, fit: Fit) -> float:
    """Squared error of a fit on the rough response."""
    s = 1j * rough.omega
    b, a = (np.polynomial.polynomial.polyval(s, c) for c in (fit.numerator, fit.denominator))
    response = b / a * np.exp(-1j * rough.omega * (fit.delay - rough.lag))
    return float(rough.weight @ np.abs(rough.response - response) ** 2)


def _from_plain(rough: RoughResponse, structure: Structure, fit: Fit) -> Real:
    """The best plain fit with its missing sections added where they hardly matter; tried first."""
    theta = list(fit.theta)
    have = fit.structure.sections
    if not have:
        theta += [0.0]
        have = (1,)
    if structure.sections[0] == 1:
        theta = theta[:2]
    elif have == (1,):
        theta += [0.1875]  # (1 + 3/4 Ts)(1 + 1/4 Ts)
    for k, order in enumerate(structure.sections[1:]):
        theta += [np.log(0.5 / (k + 1) / rough.omega[-1])] + ([0.5] if order == 2 else [])
    return np.array(theta)


def _reweighted(
    s: Complex, target: Complex, weight: Real, structure: Structure
) -> tuple[float, Real]:
    """Fit target A = B; return the output error and A by rising powers, A(0) = 1."""
    order, zeros = structure.order, structure.zeros
    below = s[:, None] ** np.arange(1, order + 1)
    above = s[:, None] ** np.arange(structure.dc_zeros, zeros + 1)
    columns = np.hstack([target[:, None] * below, -above])
    root = np.sqrt(weight)
    best = (np.inf, np.ones(order + 1))
    for _ in range(_REWEIGHTINGS):
        rows = np.vstack([(columns * root[:, None]).real, (columns * root[:, None]).imag])
        right = -np.concatenate([(target * root).real, (target * root).imag])
        solution = np.linalg.lstsq(rows, right, rcond=None)[0]
        denominator = np.concatenate([[1.0], solution[:order]])
        a = np.polynomial.polynomial.polyval(s, denominator)
        b = above @ solution[order:]
        error = float(weight @ np.abs(target - b / a) ** 2) if np.all(a != 0) else np.inf
        if error < best[0]:
            best = (error, denominator)
        root = np.sqrt(weight) / np.abs(a)
    return best


def _sections(denominator: Real, structure: Structure) -> Real | None:
    """Group the poles, mirrored into the left half plane, into the structure's sections."""
    poles = np.roots(denominator[::-1])
    if poles.size < structure.order or np.any(np.abs(poles) < 1e-9):
        return None
    poles = -np.abs(poles.real) + 1j * poles.imag
    pairs = sorted(poles[poles.imag > 1e-9], key=abs)
    real = sorted(poles[np.abs(poles.imag) <= 1e-9].real, key=abs)
    out: list[float] = []
    for order in structure.sections:
        if order == 2 and pairs:
            p = pairs.pop(0)
            out += [-2 * p.real / abs(p) ** 2, 1 / abs(p) ** 2]
        elif order == 2:
            p, q = real.pop(0), real.pop(0)
            out += [-1 / p - 1 / q, 1 / (p * q)]
        elif real:
            out += [-1 / real.pop(0)]
        else:  # two pairs cannot be three poles
            return None
    values = np.array(out)
    return np.maximum(values, 1e-4) if np.all(np.isfinite(values)) else None


def members(
    structures: tuple[StructureName, ...], group: tuple[StructureName, ...]
) -> list[Structure]:
    """Structures of a group that may be tried."""
    return [STRUCTURES[name] for name in group if name in structures]
