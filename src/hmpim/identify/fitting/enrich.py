"""Richer structures, for a record that the plain ones do not explain.

They are tried only where what the best plain structure leaves over still follows the input and
is worth more than a small share of the output: every simulation pays for every pole, and with
enough samples the smallest imperfection of real hardware is "significant".
"""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.spectral import condensed, fitted_roughly, reweighted
from hmpim.identify.fitting.start import RoughResponse, starting_values
from hmpim.identify.worth import FEW, PART
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName, theta_of

__all__ = [
    "INTEGRATING",
    "MODES",
    "PLAIN",
    "RICH",
    "Proposal",
    "about",
    "integrator_starts",
    "is_response",
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
        Share of the rough response's power that the best start misses.
    promising : bool
        Whether the least of all is not a small part of it.
    """

    structure: Structure
    starts: tuple[Real, ...]
    error: float
    promising: bool = False


def proposals(
    rough: RoughResponse,
    structures: list[Structure],
    fit: Fit,
    *,
    count: int = 5,
    all_of_them: bool = False,
) -> list[Proposal]:
    """Structures with zeros or more than two poles that the response allows, promising ones first.

    Sanathanan and Koerner's iteration on the rough response starts them, at several delays about
    that of the best fit so far, with poles in the right half plane mirrored; each start then climbs
    there by output error.

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
    rough = condensed(rough)
    reach = np.pi / rough.omega[-1]
    near = np.linspace(-1.5, 0.5, _DELAYS)
    late = np.linspace(0.75, 1.5, 4)  # a zero as fast as its pole leads
    out = []
    for structure in structures:
        turns = np.append(near, late) if structure.zeros >= structure.order else near
        delays = np.maximum(fit.delay + reach * turns, -1.0)
        lean = fit.structure.order <= 2 and not structure.dc_zeros
        starts = [_from_plain(rough, structure, fit)] if lean else []
        errors, denominators = reweighted(rough, structure, delays)
        powers = np.concatenate([np.arange(1, order + 1) for order in structure.sections])
        for i in np.argsort(errors):
            coefficients = _sections(denominators[i], structure)
            if coefficients is not None and len(starts) < count:
                theta = theta_of(structure, coefficients / rough.omega[-1] ** powers)
                starts.append(np.append(delays[i], theta))
        if starts:
            found = fitted_roughly(rough, structure, np.stack(starts))
            out.append(Proposal(structure=structure, starts=tuple(found.likely), error=found.error))
    if not all_of_them:
        out = [proposal for proposal in out if proposal.error < (1 - FEW) * _error(rough, fit)]
    least = min((proposal.error for proposal in out), default=0.0)

    out = [replace(p, promising=PART**2 * p.error <= least) for p in out]
    return sorted(out, key=lambda p: (not p.promising, p.structure.parameters))


def is_response(rough: RoughResponse, fit: Fit) -> bool:
    """Whether what a fit leaves of the rough response is a response for the most part.

    Two modes have poles and zeros enough to follow most of what is no noise.
    """
    tried = proposals(rough, [STRUCTURES["two_modes"]], fit)
    return bool(tried) and tried[0].error < PART * _error(condensed(rough), fit)


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


def about(left: RoughResponse, fit: Fit) -> RoughResponse:
    """The rough response of an output, from that of what a fit leaves over of it.

    Leakage is proportional to the signal transformed, so the residual has little.
    """
    return replace(left, response=_modelled(left, fit) + left.response)


def _modelled(rough: RoughResponse, fit: Fit) -> Complex:
    """What a fit predicts of a rough response."""
    s = 1j * rough.omega
    b, a = (np.polynomial.polynomial.polyval(s, c) for c in (fit.numerator, fit.denominator))
    return np.asarray(b / a * np.exp(-1j * rough.omega * (fit.delay - rough.lag)))


def _error(rough: RoughResponse, fit: Fit) -> float:
    """Share of the rough response's power that a fit misses."""
    response = _modelled(rough, fit)
    missed, power = (np.abs(r) ** 2 for r in (rough.response - response, rough.response))
    return float((rough.weight @ missed) / (rough.weight @ power))


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
