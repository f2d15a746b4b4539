"""Findings and parameters from clipped, held, rounded and lost samples."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hmpim.identify.effects.censored import CensoredFit
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.digits import percent
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.groups import EVERY, MODELLED
from hmpim.identify.worth import FEW, MOST, MUCH, NEARLY
from hmpim.record import Finding

__all__ = ["with_imperfections"]


def with_imperfections(
    parameters: Parameters, found: Imperfections, censored: CensoredFit | None, unit: str
) -> tuple[Parameters, tuple[Finding, ...]]:
    """Add levels, hold period and step to the parameters, and report the findings."""
    clipping, hold, rounding = found.saturation, found.hold, found.quantization
    figures = {}
    if clipping is not None:
        for name, side in (("saturation_low", clipping.low), ("saturation_high", clipping.high)):
            if side is not None:
                figures[name] = estimate(side.level, side.std**2, unit=unit)
    if hold is not None:
        figures["hold_period"] = estimate(hold.period, hold.std**2, unit="s")
    if rounding is not None:
        figures["quantization_step"] = estimate(rounding.step, rounding.std**2, unit=unit)
    if censored is not None:
        figures["noise_std"] = estimate(
            censored.noise_std,
            censored.noise_std_std**2,
            freedom=float(censored.index.size),
            unit=unit,
        )
    findings = (*_of_levels(found, parameters.noise_std, unit), *_of_lost(found))
    return replace(parameters, **figures), findings


def _of_levels(found: Imperfections, noise: Estimate | None, unit: str) -> Iterator[Finding]:
    """Clipping, hold and rounding: share, levels, period and step."""
    clipping, hold, rounding = found.saturation, found.hold, found.quantization
    if clipping is not None:
        # A rectifier clips half of the samples, all at one level.
        much = max(float(np.mean(side.at)) for side in clipping.sides) > NEARLY * MOST
        levels = [
            f"{name} {side.level:.6g} {unit}".rstrip()
            for name, side in (("low", clipping.low), ("high", clipping.high))
            if side is not None
        ]
        yield Finding(
            code="saturation",
            message=f"{100 * clipping.share:.1f} % of the samples are clipped "
            f"({', '.join(levels)}); the fit treats them as lying beyond the level. "
            + (
                "Too many are at one level for a reliable fit: lower the amplitude, or look for a "
                "rectifier."
                if much
                else "Lower the amplitude to keep the whole range."
            ),
            severity="doubt" if much else "info",
            parameters=MODELLED if much else ("saturation_low", "saturation_high"),
        )
    if hold is not None:
        yield Finding(
            code="hold",
            message=f"The output is updated only every {1e3 * hold.period:.4g} ms, first at "
            f"{1e3 * hold.phase:.4g} ms into the record; the delay stated excludes the time for "
            "which each value is held.",
            severity="info",
            parameters=("hold_period", "delay"),
        )
    if found.levels is not None:
        yield Finding(
            code="quantization",
            message=f"The output takes only {found.levels} different values, too few to follow "
            "the motion between them. Measure with a finer resolution, or a larger motion.",
            severity="doubt",
            parameters=EVERY,
        )
    elif rounding is not None and noise is not None and rounding.noise_std > MUCH * noise.value:
        yield Finding(
            code="quantization",
            message=f"The output is rounded to steps of {rounding.step:.4g} {unit}".rstrip()
            + f", {rounding.step / max(noise.value, 1e-300):.2g} times the noise. Rounding "
            "errors are not independent of each other, so the error bars are approximate.",
            severity="info",
            parameters=MODELLED,
        )


def _of_lost(found: Imperfections) -> Iterator[Finding]:
    """Samples that are excluded: repeated frames, spikes and standstills."""
    if found.repeated is not None:
        count, share = int(np.count_nonzero(found.repeated)), float(np.mean(found.repeated))
        yield Finding(
            code="repeated_frames",
            message=f"{count} samples ({percent(share)} %) repeat the one before them to the last "
            "digit, as lost frames do; they are left out.",
            severity="info",
            parameters=(),
        )
    if found.spikes is not None:
        count, share = int(np.count_nonzero(found.spikes)), float(np.mean(found.spikes))
        many = share > FEW
        yield Finding(
            code="spikes",
            message=f"{count} samples ({percent(share)} %) lie far from their neighbours "
            "and are left out. Look for loose contacts, lost bits or impacts.",
            severity="doubt" if many else "info",
            parameters=MODELLED if many else (),
        )
    if found.frozen is not None:
        yield Finding(
            code="frozen",
            message="The output stands still while the model moves, over "
            f"{percent(float(np.mean(found.frozen)))} % of the record; that part is left out. "
            "Look for lost updates, a stuck sensor, or friction.",
            severity="doubt",
            parameters=MODELLED,
        )
