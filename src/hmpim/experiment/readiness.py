"""Four questions before a run: limits, error bars, independence, and the rig's answer.

If the answer to all of them is yes, the run is safe and will reach the wanted accuracy. The
first three move nothing; the last moves the rig at a small share of the amplitude.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from hmpim.errors import ArgumentError, HmpimError
from hmpim.experiment.checks import check_stimuli, limits_by_axis
from hmpim.experiment.feel import Feel, feel
from hmpim.experiment.log import RunLog
from hmpim.optimal import RoughModel, predict_errors
from hmpim.optimal.wish import Z95
from hmpim.record import Record
from hmpim.rigs import LimitsOfAxes, Rig, stimuli_by_axis
from hmpim.stimulus import Stimulus
from hmpim.stimulus.axes import input_condition

__all__ = [
    "LIGHTS",
    "Light",
    "LightName",
    "answer_light",
    "error_light",
    "independence_light",
    "limits_light",
]

LightName = Literal["limits", "error bars", "independence", "answer"]
LIGHTS: tuple[LightName, ...] = ("limits", "error bars", "independence", "answer")
"""All questions, in the order in which they are asked."""

_SMALL = 0.05  # share of the amplitude at which the answer is asked for: the first of `Feel`
_MOST = 0.5  # of the band in which axes must be told apart: the greater part


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """The answer to one question.

    Parameters
    ----------
    name : str
        One of `LIGHTS`.
    green : bool
        Whether a run may follow.
    words : str
        What was found.

    Examples
    --------
    >>> Light(name="limits", green=True, words="all inside").green
    True
    """

    name: LightName
    green: bool
    words: str


def limits_light(rig: Rig, stimuli: Sequence[Stimulus], *, stated: LimitsOfAxes = None) -> Light:
    """Ask whether every stimulus keeps every limit of a rig, and can be stopped smoothly.

    Parameters
    ----------
    rig : Rig
        It is entered here, since some tell their limits only then.
    stimuli : sequence of Stimulus
        One for each axis that moves.
    stated : Limits, or mapping of axis to Limits, or None
        Limits beside the rig's own.

    Examples
    --------
    >>> from hmpim.rigs import Sensor
    >>> from hmpim.stimulus import Limits, design
    >>> small, large = Limits(position=1.0), Limits(position=5.0)
    >>> stimulus = design(band=(0.1, 10), duration=5, fs=100, limits=large)
    >>> limits_light(Sensor(), [stimulus], stated=small).green
    False
    """
    log = RunLog()
    try:
        with rig:
            named = _by_axis(rig, stimuli)
            check_stimuli(named, limits_by_axis(rig, named, stated=stated), rig=rig, log=log)
    except HmpimError as error:
        return Light(name="limits", green=False, words=_sentence(error))
    words = "; ".join(event.message for event in log.events if event.kind == "check")
    return Light(name="limits", green=True, words=words)


def error_light(
    stimuli: Sequence[Stimulus], *, model: RoughModel, noise_std: float, wanted: float
) -> Light:
    """Ask whether the error bars that the stimuli allow are as small as wanted.

    Parameters
    ----------
    stimuli : sequence of Stimulus
        One for each axis that moves.
    model : RoughModel
        What is roughly known of the unit.
    noise_std : float
        Of white measurement noise, in the output's unit.
    wanted : float
        Largest half interval (95 %) of the natural frequency, Hz.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=Limits(position=10))
    >>> model = RoughModel(delay=0.15, natural_frequency=10, damping_ratio=0.4)
    >>> light = error_light([stimulus], model=model, noise_std=0.1, wanted=0.1)
    >>> light.green, light.words
    (True, 'natural frequency ± 0.00629 Hz (95 %), wanted: at most 0.1 Hz')
    """
    try:
        found = [
            Z95 * predict_errors(s, model=model, noise_std=noise_std).natural_frequency
            for s in stimuli
        ]
    except HmpimError as error:
        return Light(name="error bars", green=False, words=_sentence(error))
    worst = max(found)
    where = f" on {stimuli[found.index(worst)].axis}" if len(stimuli) > 1 else ""
    return Light(
        name="error bars",
        green=worst <= wanted,
        words=f"natural frequency ± {worst:.3g} Hz (95 %){where}, wanted: at most {wanted:.3g} Hz",
    )


def independence_light(stimuli: Sequence[Stimulus]) -> Light:
    """Ask whether one record can tell the axes apart.

    Parameters
    ----------
    stimuli : sequence of Stimulus
        One for each axis that moves.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> stimulus = design(band=(0.1, 10), duration=5, fs=100, limits=Limits(position=1))
    >>> independence_light([stimulus]).words
    'one axis moves'
    """
    if len(stimuli) < 2:
        return Light(name="independence", green=True, words="one axis moves")
    bands = [s.band for s in stimuli if s.band is not None]
    try:
        if len(bands) < len(stimuli):
            raise ArgumentError("a stimulus has no band of its own")
        band = max(low for low, _ in bands), min(high for _, high in bands)
        found = input_condition(stimuli, band=band)
    except HmpimError as error:
        return Light(name="independence", green=False, words=_sentence(error))
    return Light(
        name="independence",
        green=found.share >= _MOST,
        words=f"the axes can be told apart in {100 * found.share:.0f} % of the band from "
        f"{band[0]:g} to {band[1]:g} Hz",
    )


def answer_light(
    rig: Rig,
    stimuli: Sequence[Stimulus],
    play: Callable[[Mapping[str, Stimulus]], Record],
    *,
    stated: LimitsOfAxes = None,
) -> Light:
    """Move a rig at a small share of the amplitude, and ask what the whole would bring.

    Parameters
    ----------
    rig : Rig
        What is moved; not entered here.
    stimuli : sequence of Stimulus
        At full amplitude, one for each axis that moves.
    play : callable
        Plays stimuli on the rig by axis and returns the record.
    stated : Limits, or mapping of axis to Limits, or None
        Limits beside the rig's own.

    Examples
    --------
    >>> from hmpim.experiment import run
    >>> from hmpim.rigs import Sensor
    >>> from hmpim.stimulus import Limits, design
    >>> stimulus = design(band=(0.1, 10), duration=5, fs=100, limits=Limits(position=1))
    >>> rig = Sensor(delay=0.1)
    >>> answer_light(rig, [stimulus], lambda named: run(rig, named[""], rng=1)).green
    True
    """
    try:
        named = _by_axis(rig, stimuli)
        limits = limits_by_axis(rig, named, stated=stated)
        felt = feel(play, named, limits, how=Feel(shares=(_SMALL,)))
    except HmpimError as error:
        return Light(name="answer", green=False, words=_sentence(error))
    words = " ".join(finding.message for finding in felt.findings)
    return Light(name="answer", green=felt.share == 1.0, words=words)


def _by_axis(rig: Rig, stimuli: Sequence[Stimulus]) -> dict[str, Stimulus]:
    given: Stimulus | Mapping[str, Stimulus] = (
        stimuli[0] if len(stimuli) == 1 else {s.axis: s for s in stimuli}
    )
    return stimuli_by_axis(given, rig.axes, name=repr(rig.name))


def _sentence(error: Exception) -> str:
    return " ".join(str(error).split())
