"""The data of a check: the fit, the figures from it, and the tests of the record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import HALF
from hmpim.identify.effects.gain import GainChange
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.nonlinear.bends import Bend
from hmpim.identify.reading.readings import Readings
from hmpim.identify.result import Parameters, ResponseBandwidths
from hmpim.identify.result.groups import MODELLED, PHASE_SPLIT
from hmpim.identify.worth import FEW, INTERPOLATED, TOLERATED, WORTH

__all__ = ["Evidence", "structure_in_words"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """One fitted pair before its checks."""

    joint: JointFit
    readings: Readings
    misfit: Misfit  # the part of the residual that still follows the input
    u: Real  # (n,): the input, in its own unit; empty for statistics
    fs: float  # Hz
    band: tuple[float, float]  # excited band, Hz
    fit_percent: float  # 100 (1 - ‖residual‖ / ‖deviation of the output‖)
    measured: ResponseBandwidths  # from the measured response
    spanned: Parameters  # with intervals that cover every model the record allows
    # nonlinearities that the record does not exclude; none if figures are doubted anyway
    bends: tuple[Bend, ...] = ()
    nonlinear: float = 0.0  # share of the residual's power that is known to be nonlinear
    held: bool = False  # whether the output is held, so that its measured response shows the hold
    through: bool = False  # whether the pair was identified through a loop's reference
    filled: int = 0  # samples at which an input was not measured, and was filled in
    jittered: bool = False  # whether the stamps are uneven, so that samples are interpolated
    limited: bool = False  # whether the input is the command as a unit of limited speed follows it
    gaining: GainChange | None = None  # a gain that changes along the record, if there is evidence

    @property
    def has_samples(self) -> bool:
        """Whether there are samples; statistics have none."""
        return self.u.size > 0

    @property
    def residual(self) -> Real:
        """Residual at the samples that count."""
        return self.joint.problem.counting(self.joint.best.fit.residual)

    @property
    def of_other_poles(self) -> tuple[str, ...]:
        """Figures that other poles would move.

        If the residual is white or small, the response within the band stays the same.
        """
        described = self.readings.white or self.unexplained <= TOLERATED
        return PHASE_SPLIT if described else MODELLED

    @property
    def unexplained(self) -> float:
        """R.m.s. of the residual over that of the output about its mean."""
        return 1.0 - self.fit_percent / 100.0

    @property
    def is_without_noise(self) -> bool:
        """Whether the residual may be only the error of interpolation between the samples.

        The ends of the record do not count: the input beyond them is unknown.
        """
        if self.unexplained >= WORTH:
            return False
        if not self.has_samples:
            return self.unexplained < INTERPOLATED
        fit, end = self.joint.best.fit, int(FEW * self.u.size) + 1
        inner, moves = fit.residual[end:-end], fit.prediction + fit.residual
        return float(np.sqrt(np.mean(inner**2))) < INTERPOLATED * float(np.std(moves))

    def moved(self, others: Sequence[Mapping[str, float | None]]) -> dict[str, float]:
        """Figures, except the noise, that other models move farther than an interval can cover.

        Each is given with its relative move, 0 if one of the others lacks it.
        """
        moved = {}
        for name, own in self.readings.parameters.given.items():
            if name not in MODELLED or name == "noise_std":
                continue
            values = [other.get(name) for other in others]
            far = max((abs(v - own.value) for v in values if v is not None), default=0.0)
            if None in values or far > max(FEW * HALF * own.spread, TOLERATED * abs(own.value)):
                moved[name] = far / abs(own.value) if own.value else 0.0
        return moved


_WORDS = {
    "integrator_first_order": "lagging integrator",
    "integrator_second_order": "second-order lagging integrator",
    "washout_second_order": "second-order (with a washout)",
    "band_pass": "band-pass",
    "_order": "-order",
    "_modes": "-mode",
    "_zeros": " (with two zeros)",
    "_zero": " (with a zero)",
}
"""Names of structures, or parts of them, in words."""


def structure_in_words(name: str) -> str:
    """Return a structure's name in plain words.

    Examples
    --------
    >>> structure_in_words("second_order_zero"), structure_in_words("static")
    ('second-order (with a zero)', 'static')
    """
    if name.startswith(("iir", "bilinear")):
        return f"{name.split('_')[1]}-pole filter"
    for part, words in _WORDS.items():
        name = name.replace(part, words)
    return name.replace("_", " ")
