"""Fig. 17's part of the table: printed, step by step, jointly fitted, true, and at best."""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.experiment import run
from hmpim.identify import Estimate, PairIdentification, PaperAnalysis
from hmpim.identify.section_iv.response import delay_phase, falling_crossing
from hmpim.record import Record
from hmpim.report.paper.bound import Bound, phase90, resonance_db
from hmpim.report.paper.odds import Readings
from hmpim.report.paper.rows import Row, agreement, shown
from hmpim.rigs import Sensor
from hmpim.stimulus import Stimulus

__all__ = ["Sample", "sample_rows"]

CLAIM = 0.03  # the paper's "noise and bias within 3 %"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """The sample system, its record, and all that is read off it.

    `many` are the paper's steps on further records, which differ in their noise alone.
    """

    system: Sensor
    stimulus: Stimulus
    record: Record
    analysis: PaperAnalysis
    pair: PairIdentification
    bound: Bound
    many: Readings

    @property
    def pure_delay(self) -> float:
        """The joint fit's, in s; the true one where it has none."""
        found = self.pair.parameters.delay
        return self.system.delay if found is None else found.value

    @property
    def natural_by_pure_delay(self) -> float | None:
        """Where the phase lies 90° below the pure delay's lag (Fig. 16), in Hz."""
        f = self.analysis.band_frequency
        bare = self.analysis.phase - delay_phase(f, self.pure_delay)
        return falling_crossing(f, bare, -90.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Quantity:
    """One quantity of Fig. 17 in the unit it is shown in, which is `factor` times its own."""

    name: str
    paper: str
    key: str
    joint: Estimate | None
    bound: float | None
    truth: float
    unit: str = ""
    factor: float = 1.0
    why: str


def sample_rows(sample: Sample) -> tuple[Row, ...]:
    """Return the rows of Figs 16 and 17: each quantity by the steps, and by the joint fit."""
    rows = [
        Row(
            figure=16,
            where="Fig. 16",
            quantity="Natural frequency: 90° below the lag of the pure delay",
            value=sample.natural_by_pure_delay,
            truth=sample.system.natural_frequency,
            unit="Hz",
            why="Not printed. The joint fit's pure delay is taken out, on Fig. 17's record.",
        )
    ]
    for quantity in _quantities(sample):
        rows += _pair_of_rows(quantity, sample.many)
    return tuple(rows)


def _pair_of_rows(quantity: _Quantity, many: Readings) -> list[Row]:
    def scaled(value: float | None) -> float | None:
        return None if value is None else quantity.factor * value

    joint = quantity.joint
    found, records = many.found(quantity.key).size, many.delay.size
    sure = ""
    if joint is not None:
        away = abs(joint.value - quantity.truth) / joint.spread
        sure = f"Jointly with all others; {away:.1f} standard deviations from the truth."
    return [
        Row(
            figure=17,
            where="Fig. 17",
            quantity=f"{quantity.name}, by the paper's steps",
            paper=quantity.paper,
            value=scaled(many.mean(quantity.key)),
            std=scaled(many.scatter(quantity.key) or None),
            text=f"found in {found} of {records} records",
            truth=scaled(quantity.truth),
            unit=quantity.unit,
            why=quantity.why,
        ),
        Row(
            figure=17,
            where="Fig. 17",
            quantity=f"{quantity.name}, joint fit",
            paper=quantity.paper,
            value=None if joint is None else scaled(joint.value),
            text="none",
            std=None if joint is None else scaled(joint.spread),
            bound=scaled(quantity.bound),
            truth=scaled(quantity.truth),
            unit=quantity.unit,
            why=sure,
        ),
    ]


def _quantities(sample: Sample) -> list[_Quantity]:
    many, joint = sample.many, sample.pair.parameters
    bound, system = sample.bound, sample.system
    natural, damping = system.natural_frequency or 0.0, system.damping_ratio or 0.0
    slope = system.delay + 2.0 * damping / (2.0 * math.pi * natural)
    left = _left_over(sample)
    most = 0.5 * math.pi / (2.0 * math.pi * system.delay)
    printed = 1.78
    turned = 360.0 * natural * ((many.mean("delay") or 0.0) - system.delay) - 90.0
    without_crossing = (
        f"Without {1e3 * (many.mean('delay') or 0.0):.0f} ms of delay the phase at "
        f"{natural:g} Hz is {shown(round(turned))}° and not −90°; the few crossings of −90° lie "
        "where the output is below the noise. Without the pure delay it passes −90° at "
        f"{many.mean('natural_by_pure_delay') or 0.0:.2f} ± "
        f"{many.scatter('natural_by_pure_delay') or 0.0:.2f} Hz."
    )
    return [
        _Quantity(
            name="Delay",
            paper="150 ms",
            key="delay",
            joint=joint.delay,
            bound=bound.delay,
            truth=system.delay,
            unit="ms",
            factor=1e3,
            why="Equation (8) finds the delay and what the dynamics add. At low frequency they "
            f"add 2ζ/ωn, which makes {1e3 * slope:.0f} ms; the peak is later still, and a whole "
            f"number of {1e3 / sample.stimulus.fs:g} ms samples.",
        ),
        _Quantity(
            name="Bias",
            paper="0.6 deg within 3 %",
            key="bias",
            joint=joint.bias,
            bound=bound.bias,
            truth=system.bias,
            unit="deg",
            why="Equation (11) is the r.m.s. error, which contains the noise and the "
            f"{left:.2g} deg rms that the dynamics cause at "
            f"{sample.stimulus.peaks.position:.3g} deg of amplitude. It is within 3 % "
            f"only up to {_largest(sample, bias=True):.2g} deg of amplitude.",
        ),
        _Quantity(
            name="Noise, 1σ",
            paper="0.1 deg within 3 %",
            key="noise_std",
            joint=joint.noise_std,
            bound=bound.noise_std,
            truth=system.noise_std,
            unit="deg",
            why="The error that the dynamics cause counts as noise in (14). It is within 3 % only "
            f"up to {_largest(sample, bias=False):.2g} deg of amplitude; the paper prints none.",
        ),
        _Quantity(
            name="Scale factor",
            paper="",
            key="scale_factor",
            joint=joint.scale_factor,
            bound=bound.scale_factor,
            truth=system.scale_factor,
            why="Not printed.",
        ),
        _Quantity(
            name="Natural frequency",
            paper="9.83 Hz",
            key="natural_frequency",
            joint=joint.natural_frequency,
            bound=bound.natural_frequency,
            truth=natural,
            unit="Hz",
            why=without_crossing,
        ),
        _Quantity(
            name="Damping ratio",
            paper="0.4",
            key="damping_ratio",
            joint=joint.damping_ratio,
            bound=bound.damping_ratio,
            truth=damping,
            why="From the hump, which the window lowers and the noise raises. The paper reads "
            "only that it is below 0.7.",
        ),
        _Quantity(
            name="Hump above DC",
            paper="~3 dB",
            key="peak_gain_db",
            joint=joint.peak_gain_db,
            bound=bound.peak_gain_db,
            truth=resonance_db(damping),
            unit="dB",
            why=agreement(
                many.mean("peak_gain_db"), 3.0, within=0.5, because="~3 dB is read off a plot"
            ),
        ),
        _Quantity(
            name="Bandwidth (−90°)",
            paper=f"{printed:g} Hz",
            key="bandwidth_phase90",
            joint=joint.bandwidth_phase90,
            bound=bound.bandwidth_phase90,
            truth=phase90(system.delay, natural, damping),
            unit="Hz",
            why=f"The stated system passes −90° at {phase90(system.delay, natural, damping):.3f} "
            f"Hz; its {1e3 * system.delay:g} ms delay alone would at {most:.3f} Hz. {printed:g} Hz "
            "lies above both, so that the stated system cannot give it.",
        ),
    ]


def _left_over(sample: Sample) -> float:
    """Root mean square, in deg, of what the steps' delay leaves of the dynamics, without noise."""
    clean = run(replace(sample.system, noise_std=0.0, bias=0.0), sample.stimulus)
    u, y = clean.inputs[0].values, clean.outputs[0].values
    lag = round((sample.analysis.estimates.delay or 0.0) * sample.stimulus.fs)
    return float(np.std(u[: u.size - lag] - y[lag:]))


def _largest(sample: Sample, *, bias: bool) -> float:
    """Largest amplitude, in deg, at which (11) or (14) is still expected within 3 %."""
    system = sample.system
    per_degree = _left_over(sample) / sample.stimulus.peaks.position
    own = system.noise_std**2 + (system.bias**2 if bias else 0.0)
    allowed = ((1.0 + CLAIM) * (system.bias if bias else system.noise_std)) ** 2 - own
    return math.sqrt(max(allowed, 0.0)) / per_degree
