"""A wish made a design: stimuli, what they reach, what they will tell."""

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

from hmpim.errors import ArgumentError
from hmpim.optimal import FAMILIES, PARAMETERS, Accuracy, RoughModel, gentlest, predict_errors
from hmpim.optimal.wish import Z95
from hmpim.stimulus import Limits, Stimulus, design
from hmpim.stimulus.axes import AxisPlan, design_axes
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import rate_unit
from hmpim.workbench.desks import AxisRow, Model, Wish

__all__ = [
    "MOST_SAMPLES",
    "PeakRow",
    "digest",
    "error_rows",
    "limits_of",
    "peak_rows",
    "rough",
    "stimuli_of",
    "stimulus_part",
]


MOST_SAMPLES = 10_000_000
"""Samples of a design on a page: about ten seconds of work, for which every window waits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakRow:
    """A peak against its limit."""

    axis: str
    quantity: str
    peak: float
    limit: float
    unit: str


def digest(wish: Wish, rig: str) -> str:
    """Return what tells one design on one rig from any other.

    Examples
    --------
    >>> digest(Wish(), "bench") == digest(Wish(), "bench")
    True
    >>> digest(Wish(), "bench") == digest(Wish(), "table")
    False
    """
    text = json.dumps([asdict(wish), rig], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def limits_of(row: AxisRow, unit: str) -> Limits:
    """Limits of a row, with the position that is to be used."""
    return Limits(
        position=min(row.amplitude, row.position),
        velocity=row.velocity,
        acceleration=row.acceleration,
        unit=unit,
    )


def stimuli_of(wish: Wish) -> tuple[Stimulus, ...]:
    """Design what is wished: one axis with the sliders, or several that can be told apart.

    What was designed last is kept: the window's α changes no stimulus, and a rough model changes
    the gentlest alone.

    Parameters
    ----------
    wish : Wish
        As it is on the page.

    Raises
    ------
    HmpimError
        If it cannot be met; the message says what is enough.
    """
    samples = len(wish.rows) * wish.duration * wish.fs
    if samples > MOST_SAMPLES:
        raise ArgumentError(
            f"{wish.duration:g} s at {wish.fs:g} Hz are {samples:.3g} samples of all axes; at most "
            f"{MOST_SAMPLES:.0e} are designed on a page. Take a shorter time or a lower rate, or "
            "the command hmpim design"
        )
    return _designed_once(stimulus_part(wish))


def stimulus_part(wish: Wish) -> Wish:
    """Return a wish without what changes no stimulus.

    Examples
    --------
    >>> stimulus_part(Wish(alpha=2.0)) == stimulus_part(Wish(alpha=3.0))
    True
    """
    model = wish.model if wish.gentlest else Model()
    return replace(wish, alpha=Wish().alpha, model=model)


@lru_cache(maxsize=16)
def _designed_once(wish: Wish) -> tuple[Stimulus, ...]:
    if wish.gentlest:
        return (_gentlest(wish),)
    if len(wish.rows) > 1:
        plans = [
            AxisPlan(axis=r.name, limits=limits_of(r, wish.unit), band=(r.low, r.high))
            for r in wish.rows
        ]
        return design_axes(plans, duration=wish.duration, fs=wish.fs)
    (row,) = wish.rows
    return (
        design(
            band=(row.low, row.high),
            duration=wish.duration,
            fs=wish.fs,
            limits=limits_of(row, wish.unit),
            extinction="auto" if wish.extinction is None else wish.extinction,
            lead="auto" if wish.lead is None else wish.lead,
            axis=row.name,
        ),
    )


def _gentlest(wish: Wish) -> Stimulus:
    """Return the stimulus of the smallest peak acceleration that tells what is wanted."""
    if len(wish.rows) > 1:
        raise ArgumentError(
            f"the gentlest stimulus is sought for one axis, and the design has {len(wish.rows)}; "
            "remove the others, or solve the sweeps"
        )
    (row,) = wish.rows
    found = gentlest(
        accuracy=Accuracy(natural_frequency=0.01 * wish.model.wanted),
        model=rough(wish.model),
        noise_std=wish.model.noise_std,
        limits=limits_of(row, wish.unit),
        fs=wish.fs,
        duration=wish.duration,
        families=FAMILIES,
    )
    return replace(found.stimulus, axis=row.name)


def peak_rows(wish: Wish, stimuli: tuple[Stimulus, ...]) -> tuple[PeakRow, ...]:
    """Return the true peaks of each axis beside its limits."""
    return tuple(
        PeakRow(
            axis=stimulus.axis,
            quantity=quantity,
            peak=float(getattr(stimulus.peaks, quantity)),
            limit=float(getattr(row, quantity)),
            unit=rate_unit(wish.unit, order),
        )
        for row, stimulus in zip(wish.rows, stimuli, strict=True)
        for order, quantity in enumerate(QUANTITIES[:3])
    )


def rough(model: Model) -> RoughModel:
    """Return what is roughly known of the unit."""
    return RoughModel(
        delay=model.delay,
        natural_frequency=model.natural_frequency,
        damping_ratio=model.damping_ratio,
    )


def error_rows(wish: Wish, stimulus: Stimulus) -> tuple[tuple[str, float], ...]:
    """Return the error bars (95 %) that a stimulus will allow, parameter by parameter."""
    found = predict_errors(stimulus, model=rough(wish.model), noise_std=wish.model.noise_std)
    return tuple((name, Z95 * float(getattr(found, name))) for name in PARAMETERS)
