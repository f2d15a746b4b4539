"""What a check looks at: the fit, what was read off it, and what the record says beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM, HALF
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
    """One pair, fitted and read, before anything is said of it.

    Parameters
    ----------
    joint : JointFit
        The fit.
    readings : Readings
        What was read off it.
    misfit : Misfit
        What the residual still owes to the input.
    u : ndarray, shape (n,)
        The input, in its own unit.
    fs : float
        Rate in Hz.
    band : (float, float)
        Excited band in Hz.
    fit_percent : float
        100 (1 - ‖residual‖ / ‖deviation of the output‖).
    measured : ResponseBandwidths
        Bandwidths read off the measured response.
    spanned : Parameters
        What was read off the fit, with intervals that cover every model the record allows.
    bends : tuple of Bend
        Nonlinearities that the record leaves in question; none where figures are doubted anyway.
    nonlinear : float
        Share of the residual's power that is known to be nonlinear; 0 where none is.
    held : bool
        Whether the output is held, so that its measured response shows the hold too.
    through : bool
        Whether the pair was identified through a loop's reference.
    jittered : bool
        Whether the stamps strayed from a uniform clock, so that samples are interpolated.
    limited : bool
        Whether the input is what a unit of limited speed follows, and not what was recorded.
    gaining : GainChange or None
        What is known of a gain that changes along the record; None where nothing says so.
    """

    joint: JointFit
    readings: Readings
    misfit: Misfit
    u: Real
    fs: float
    band: tuple[float, float]
    fit_percent: float
    measured: ResponseBandwidths
    spanned: Parameters
    bends: tuple[Bend, ...] = ()
    nonlinear: float = 0.0
    held: bool = False
    through: bool = False
    jittered: bool = False
    limited: bool = False
    gaining: GainChange | None = None

    @property
    def has_samples(self) -> bool:
        """Whether there are samples; statistics have none."""
        return self.u.size > 0

    @property
    def of_other_poles(self) -> tuple[str, ...]:
        """Figures that other poles would move.

        The response within the band is the same with them if the model leaves white noise, or
        little of the output; of one that leaves more, no figure is known.
        """
        described = self.readings.white or self.unexplained <= TOLERATED
        return PHASE_SPLIT if described else MODELLED

    @property
    def unexplained(self) -> float:
        """R.m.s. of the residual over that of the output about its mean."""
        return 1.0 - self.fit_percent / 100.0

    @property
    def owed(self) -> float:
        """Share of the residual's power that still follows the input; 0 if by chance, or little."""
        told = self.misfit.probability < FALSE_ALARM and self.misfit.share > 2 * FEW
        return self.misfit.share if told else 0.0

    @property
    def is_without_noise(self) -> bool:
        """Whether the residual may be the error of interpolation between the samples.

        It is greatest at the ends of a record, for want of the input beyond them.
        """
        if self.unexplained >= WORTH:
            return False
        if not self.has_samples:
            return self.unexplained < INTERPOLATED
        fit, end = self.joint.best.fit, int(FEW * self.u.size) + 1
        inner, moves = fit.residual[end:-end], fit.prediction + fit.residual
        return float(np.sqrt(np.mean(inner**2))) < INTERPOLATED * float(np.std(moves))

    def moved(self, others: Sequence[Mapping[str, float | None]]) -> dict[str, float]:
        """Figures that others put farther off than an interval can cover, the noise apart.

        Each with the share of itself by which it moves; 0 where one of the others does not give it.
        """
        moved = {}
        for name in MODELLED:
            own = getattr(self.readings.parameters, name)
            if own is None or name == "noise_std":
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
