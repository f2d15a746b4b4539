"""Fig. 15: a seeker and its tracker, stepped in time, stimulated by a line-of-sight rate."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from hmpim.experiment import run
from hmpim.identify import PaperAnalysis, paper_analysis
from hmpim.plots.style import draw_level, draw_mark, new_figure
from hmpim.report.figures import Picture
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.panels import response_axes
from hmpim.report.paper.rows import Row, agreement
from hmpim.rigs import FunctionRig
from hmpim.stimulus import Limits, design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Seeker", "seeker_chapter"]

SEED = 15
FS = 1000.0  # Hz, of the simulation and of the record


@dataclass(slots=True, kw_only=True)
class Seeker:
    """A seeker on its platform, tracking a target.

    The tracker sees the pointing error, line of sight minus platform angle, `delay` seconds
    late; the platform is commanded to turn at `track_gain` times that, and follows its command
    with a first-order lag. From line-of-sight rate to platform rate command that is::

        K e^(-sτ) / (s + K e^(-sτ) / (1 + sT))

    Parameters
    ----------
    track_gain : float
        K in 1/s.
    delay : float
        τ in s: exposure, read-out and processing; a whole number of steps.
    lag : float
        T in s, of the platform's rate loop.
    noise_std : float
        Of the seen error, in deg.
    step : float
        Interval of the simulation in s.

    Examples
    --------
    >>> seeker = Seeker()
    >>> held = [seeker(2.0) for _ in range(3000)]
    >>> abs(held[-1] - 2.0) < 0.05  # a steady line-of-sight rate is followed
    True
    """

    track_gain: float = 5.0
    delay: float = 0.04
    lag: float = 0.01
    noise_std: float = 0.002
    step: float = 1.0 / FS
    _random: np.random.Generator = field(init=False, repr=False)
    _seen: deque[float] = field(init=False, repr=False)
    _line_of_sight: float = field(init=False, repr=False)
    _last_rate: float = field(init=False, repr=False)
    _platform: float = field(init=False, repr=False)
    _platform_rate: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Return to rest, pointing at the target."""
        self._random = np.random.default_rng(SEED)
        self._seen = deque([0.0] * (round(self.delay / self.step) + 1))
        self._line_of_sight = self._last_rate = 0.0
        self._platform = self._platform_rate = 0.0

    def __call__(self, rate: float) -> float:
        """Take the line-of-sight rate at the next instant; return the command, both deg/s."""
        h = self.step
        self._line_of_sight += 0.5 * h * (rate + self._last_rate)
        self._last_rate = rate
        self._seen.append(self._line_of_sight - self._platform)
        self._seen.popleft()
        command = self.track_gain * (
            self._seen[0] + self.noise_std * float(self._random.standard_normal())
        )
        fading = math.exp(-h / self.lag)
        mean = command + (self._platform_rate - command) * (1.0 - fading) * self.lag / h
        self._platform += h * mean
        self._platform_rate = command + (self._platform_rate - command) * fading
        return command

    def bandwidth(self) -> float:
        """Frequency in Hz at which the closed form's phase is -90°."""

        def real_part(f: float) -> float:
            s = 2j * math.pi * f
            seen = self.track_gain * np.exp(-s * self.delay)
            return float((seen / (s + seen / (1.0 + s * self.lag))).real)

        return float(brentq(real_part, 0.1, 5.0))


def seeker_chapter() -> Chapter:
    """Make Fig. 15.

    Examples
    --------
    >>> (row,) = seeker_chapter().rows
    >>> row.paper, round(row.value, 1)
    ('~1.8 Hz', 1.8)
    """
    seeker = Seeker()
    limits = Limits(position=10.0, unit="deg")
    stimulus = design(band=(0.1, 10.0), duration=20.0, fs=FS, limits=limits, extinction=1.0, lead=0)
    rig = FunctionRig(
        function=seeker,
        mode="sample",
        reset=seeker.reset,
        measures="velocity",
        name="seeker",
        input_name="line-of-sight rate",
        output_name="platform rate command",
    )
    record = run(rig, stimulus)
    analysis = paper_analysis(
        record.inputs[0].values, record.outputs[0].values, FS, band=record.band
    )
    found = analysis.estimates.bandwidth_phase90
    made = (
        f"track loop of gain {seeker.track_gain:g} 1/s, processing delay "
        f"{1e3 * seeker.delay:g} ms, rate loop with time constant {1e3 * seeker.lag:g} ms"
    )
    where = "nowhere" if found is None else f"at {found:.3g} Hz"
    picture = Picture(
        key="fig15",
        title="Example seeker model frequency response",
        caption=f"A model of our own, stepped in time: {made}. Input: the line-of-sight rate of "
        f"a sweep; output: the platform rate command. The phase is −90° {where}, found "
        "automatically.",
        description=f"Magnitude and phase of a seeker; −90° {where}.",
        figure=_figure_15(analysis),
    )
    row = Row(
        figure=15,
        where="Fig. 15",
        quantity="Bandwidth (−90°) of a seeker and tracker",
        paper="~1.8 Hz",
        value=found,
        truth=seeker.bandwidth(),
        unit="Hz",
        why=agreement(
            found,
            1.8,
            within=0.05,
            because="the paper's seeker is not described; ours is made to be alike, and the "
            "true figure is its closed form's",
        ),
    )
    return Chapter(pictures={15: picture}, rows=(row,))


def _figure_15(analysis: PaperAnalysis) -> "Figure":
    figure, (magnitude, phase) = new_figure(2, height=2.3)
    response_axes(figure, magnitude, phase, analysis)
    draw_level(phase, (-90.0,), label="−90°", colour="muted")
    found = analysis.estimates.bandwidth_phase90
    if found is not None:
        draw_mark(phase, found, label=f"−90° at {found:.3g} Hz", text_at=0.3, side="left")
    return figure
