"""Richer structures, for a record that the plain ones do not explain.

They are tried only where the residual of the best plain structure follows the input and is more
than a small share of the output: every pole slows all simulations, and with enough samples the
smallest imperfection of real hardware is "significant".
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
    "integrator_starts",
    "is_response",
    "members",
    "proposals",
    "with_fit",
    "without_fast",
]

PLAIN: tuple[StructureName, ...] = ("static", "first_order", "second_order")
RICH: tuple[StructureName, ...] = (
    "first_order_zero",
    "second_order_zero",
    "second_order_zeros",
    "third_order",
    "third_order_zero",
    "third_order_zeros",
    "fourth_order",
    "fifth_order",
    "sixth_order",
    "two_modes",
    "washout",
    "band_pass",
    "washout_second_order",
    "second_order_high_pass",
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
"""Number of delays to start from, around that of the best fit so far."""


def integrator_starts(rough: RoughResponse, structure: Structure) -> list[Real]:
    """Starts for an integrator: those of its other poles, from the input's running sum.

    Parameters
    ----------
    rough : RoughResponse
        From the running sum of the input to the output.
    structure : Structure
        An integrator, alone or with other poles.
    """
    return starting_values(rough, STRUCTURES[PLAIN[structure.order]])  # one for each order


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Proposal:
    """A structure with zeros or more than two poles, and its starts, the most promising first.

    `error` is the share of the rough response's power that the best start misses; `promising` says
    whether no other structure misses far less.
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
    all_of_them: bool = False,
) -> list[Proposal]:
    """Which of `structures` the rough response supports, promising ones first.

    Sanathanan and Koerner's iteration on the rough response yields starts at several delays around
    that of the best `fit` so far, poles in the right half plane mirrored; each start is then
    improved there by output error. With `all_of_them`, structures without support are kept too.
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
            if len(starts) == 5:
                break
            coefficients = _sections(denominators[i], structure)
            theta = theta_of(structure, coefficients / rough.omega[-1] ** powers)
            starts.append(np.append(delays[i], theta))
        found = fitted_roughly(rough, structure, np.stack(starts))
        out.append(Proposal(structure=structure, starts=tuple(found.likely), error=found.error))
    if not all_of_them:
        out = [proposal for proposal in out if proposal.error < (1 - FEW) * _error(rough, fit)]
    least = min((proposal.error for proposal in out), default=0.0)
    out = [replace(p, promising=PART**2 * p.error <= least) for p in out]
    return sorted(out, key=lambda p: (not p.promising, p.structure.parameters))


def is_response(rough: RoughResponse, fit: Fit) -> bool:
    """Whether a fit's residual in the rough response is mostly a response.

    Two modes have enough poles and zeros to follow most of any response.
    """
    tried = proposals(rough, [STRUCTURES["two_modes"]], fit)
    return bool(tried) and tried[0].error < PART * _error(condensed(rough), fit)


def without_fast(fit: Fit, structure: Structure) -> Real | None:
    """Start of a plainer structure, (1 + order,): the slowest poles of a fit, the others as delay.

    If only the structure has an integrator, that replaces the slowest pole. None where this would
    split a pair of poles.
    """
    whole = fit.denominator[fit.structure.integrators :]
    poles = sorted(np.roots(whole[::-1]), key=lambda p: (abs(p), p.imag))
    slow = poles[: structure.integrators - fit.structure.integrators]
    kept: list[complex] = []
    for pole in poles[len(slow) :]:
        if len(kept) + (1 if pole.imag == 0.0 else 2) <= structure.order and pole.imag >= 0.0:
            kept += [pole] if pole.imag == 0.0 else [pole, pole.conjugate()]
    denominator = np.real(np.polynomial.polynomial.polyfromroots(kept))
    if len(kept) < structure.order:
        return None
    denominator = denominator / denominator[0]
    coefficients = _sections(denominator, structure)
    late = fit.delay + whole[1] + sum((1.0 / p).real for p in slow)
    late -= denominator[1] if kept else 0.0
    if structure.zeros == structure.dc_zeros:  # without zeros of its own: the fit's become delay
        first, second = (*fit.numerator, 0.0)[structure.dc_zeros : structure.dc_zeros + 2]
        late -= second / first if first else 0.0
    return np.concatenate([[late], theta_of(structure, coefficients)])


def with_fit(residual: RoughResponse, fit: Fit) -> RoughResponse:
    """The rough response of an output, from that of a fit's residual.

    Leakage is proportional to the transformed signal, so a residual has little.
    """
    return replace(residual, response=_modelled(residual, fit) + residual.response)


def _modelled(rough: RoughResponse, fit: Fit) -> Complex:
    """A fit's prediction of a rough response."""
    s = 1j * rough.omega
    b, a = (np.polynomial.polynomial.polyval(s, c) for c in (fit.numerator, fit.denominator))
    return np.asarray(b / a * np.exp(-1j * rough.omega * (fit.delay - rough.lag)))


def _error(rough: RoughResponse, fit: Fit) -> float:
    """Share of the rough response's power that a fit misses."""
    response = _modelled(rough, fit)
    missed, power = (np.abs(r) ** 2 for r in (rough.response - response, rough.response))
    return float((rough.weight @ missed) / (rough.weight @ power))


def _from_plain(rough: RoughResponse, structure: Structure, fit: Fit) -> Real:
    """The best plain fit, the missing sections added where they hardly matter."""
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


def _sections(denominator: Real, structure: Structure) -> Real:
    """Group the poles, mirrored into the left half plane, into the structure's sections."""
    poles = np.roots(denominator[::-1])
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
        else:
            out += [-1 / real.pop(0)]
    return np.maximum(out, 1e-4)


def members(
    structures: tuple[StructureName, ...], group: tuple[StructureName, ...]
) -> list[Structure]:
    """Structures of a group that may be tried."""
    return [STRUCTURES[name] for name in group if name in structures]
