"""The words of a report: what each parameter is, what each verdict means, why figures differ."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from hmpim.identify import Estimate, Identification, PairIdentification, Verdict
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import FIXED_UNITS, in_words
from hmpim.record import INTERSAMPLE_WORDS, Finding
from hmpim.report.numbers import format_estimate, format_number

__all__ = [
    "GLOSSARY",
    "VERDICTS",
    "ParameterWords",
    "by_weight",
    "doubtful_and_ok",
    "fixed_unit",
    "headline",
    "label_of",
    "leading",
    "listed",
    "nonlinear_facts",
    "paper_value",
    "remark",
    "structure_words",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterWords:
    """A parameter's name in the result, for people, its meaning, and why the paper's differs.

    `differs` is empty where the paper gives no figure; `positive` says that the quantity cannot
    be 0 or less.
    """

    name: str
    label: str
    meaning: str
    differs: str = ""
    positive: bool = False

    @property
    def inline(self) -> str:
        """The name within a sentence."""
        return in_words(self.name)


GLOSSARY: tuple[ParameterWords, ...] = (
    ParameterWords(
        name="delay",
        label="Delay, pure",
        meaning="Time by which the output lags at every frequency alike: transport, processing, "
        "waiting for the next sample. The lag of the dynamics is not part of it.",
        differs="the peak of the cross-correlation (8) is the delay plus what the dynamics add, "
        "and falls on a whole sample",
    ),
    ParameterWords(
        name="delay_correlation",
        label="Delay, by correlation",
        meaning="Lag at which the cross-correlation of input and output peaks, equation (8): the "
        "pure delay plus what the dynamics add for this input.",
    ),
    ParameterWords(
        name="delay_low_frequency",
        label="Delay, low frequency",
        meaning="Slope of the phase towards zero frequency: how late slow motion arrives, "
        "dynamics included.",
    ),
    ParameterWords(
        name="scale_factor",
        label="Scale factor",
        meaning="Ratio of output to input at zero frequency, without the bias.",
        differs="equation (13) is a ratio of samples at the slow start of the sweep, after the "
        "bias of (11), which is too large, is subtracted",
    ),
    ParameterWords(
        name="bias",
        label="Bias",
        meaning="Output when the input is zero.",
        differs="equation (11) is the r.m.s. error, which also contains noise and the error that "
        "the dynamics cause",
    ),
    ParameterWords(
        name="noise_std",
        label="Noise",
        meaning="Standard deviation of the part of the output that the model cannot predict.",
        differs="equation (14) counts the error that scale factor and dynamics cause as noise",
        positive=True,
    ),
    ParameterWords(
        name="natural_frequency",
        label="Natural frequency",
        meaning="Undamped natural frequency of second-order dynamics: the frequency at which "
        "their own phase is −90°.",
        differs="it is read off a noisy phase from which (25) subtracts the delay of (8), which "
        "is too long",
        positive=True,
    ),
    ParameterWords(
        name="damping_ratio",
        label="Damping ratio",
        meaning="Damping of second-order dynamics over critical damping: below 0.7 the magnitude "
        "has a peak, above 1 the step response does not overshoot.",
        differs="it is read off the peak of a noisy, windowed magnitude",
        positive=True,
    ),
    ParameterWords(
        name="time_constant",
        label="Time constant",
        meaning="Time that first-order dynamics take to cover 63 % of a step.",
        positive=True,
    ),
    ParameterWords(
        name="bandwidth_phase90",
        label="Bandwidth, −90°",
        meaning="Frequency at which the output lags by 90° in total, delay included: the paper's "
        "measure of merit.",
        differs="it is read off one noisy, windowed ratio of spectra",
        positive=True,
    ),
    ParameterWords(
        name="bandwidth_phase90_without_delay",
        label="Bandwidth, −90° without delay",
        meaning="Frequency at which the phase of the dynamics alone, without the delay, is −90°.",
        positive=True,
    ),
    ParameterWords(
        name="bandwidth_3db",
        label="Bandwidth, −3 dB",
        meaning="Frequency at which the magnitude has fallen 3 dB below that at zero frequency.",
        differs="it is read off one noisy, windowed ratio of spectra",
        positive=True,
    ),
    ParameterWords(
        name="peak_gain_db",
        label="Peak gain",
        meaning="Height of the magnitude's peak above its value at zero frequency.",
        differs="noise and window change the height of a peak",
    ),
    ParameterWords(
        name="hold_period",
        label="Hold period",
        meaning="Interval at which the output is updated; in between it is held.",
        positive=True,
    ),
    ParameterWords(
        name="saturation_low",
        label="Saturation, low",
        meaning="Lowest value that the output reaches: its stop.",
    ),
    ParameterWords(
        name="saturation_high",
        label="Saturation, high",
        meaning="Highest value that the output reaches: its stop.",
    ),
    ParameterWords(
        name="quantization_step",
        label="Quantisation step",
        meaning="Smallest step of the output.",
        positive=True,
    ),
)

_LABELS = {words.name: words.label for words in GLOSSARY}


def label_of(name: str) -> str:
    """Return what a report calls a parameter.

    Examples
    --------
    >>> label_of("bandwidth_phase90"), label_of("fit_percent")
    ('Bandwidth, −90°', 'Fit percent')
    """
    return _LABELS.get(name, name.replace("_", " ").capitalize())


def fixed_unit(name: str) -> str:
    """Return the unit of a parameter that has the same one in every record; '' for any other.

    Examples
    --------
    >>> fixed_unit("delay_correlation"), fixed_unit("peak_gain_db"), fixed_unit("bias")
    ('s', 'dB', '')
    """
    return FIXED_UNITS.get(name, "")


VERDICTS: dict[Verdict, str] = {
    "ok": "Model identified",
    "doubtful": "Use with care",
    "not_identifiable": "Not identifiable",
}

_STRUCTURES = {
    "static": "no dynamics",
    "first_order": "first order",
    "second_order": "second order",
    "second_order_zero": "second order with a zero",
    "first_order_zero": "first order with a zero",
    "second_order_zeros": "second order with two zeros",
    "third_order_zero": "third order with a zero",
    "third_order_zeros": "third order with two zeros",
    "two_modes": "two modes",
    "three_modes": "three modes",
    "four_modes": "four modes",
    "five_modes": "five modes",
    "six_modes": "six modes",
    "seven_modes": "seven modes",
    "eight_modes": "eight modes",
    "washout": "a washout",
    "band_pass": "a band-pass",
    "washout_second_order": "second order with a washout",
    "second_order_high_pass": "a second-order high pass",
}

_PARTS = {
    "static": "a scale factor",
    "two_modes": "two modes",
    "three_modes": "three modes",
    "four_modes": "four modes",
    "five_modes": "five modes",
    "six_modes": "six modes",
    "seven_modes": "seven modes",
    "eight_modes": "eight modes",
    "washout": "a washout",
    "band_pass": "a band-pass",
    "washout_second_order": "a second order with a washout",
    "second_order_high_pass": "a second-order high pass",
    "integrator": "an integrator",
    "integrator_first_order": "an integrator with a first-order lag",
    "integrator_second_order": "an integrator with a second-order lag",
}
_ORDERED = re.compile(r"(?P<order>[a-z]+)_order(?P<zeros>|_zero|_zeros)")
_ZEROS = {"": "", "_zero": " with a zero", "_zeros": " with two zeros"}

_MOST = 4
"""Pairs, or figures of one, that a sentence names."""

_COUNTS = {1: "one pole", 2: "two poles", 3: "three poles", 4: "four poles"}

_FILTERS = {
    "fir": "a filter without poles",
    **{f"iir_{n}": f"a filter of {poles}" for n, poles in _COUNTS.items()},
    **{f"iir_{n}_zeros": f"a filter of {poles} and zeros" for n, poles in _COUNTS.items()},
    **{f"bilinear_{n}": f"a bilinear filter of {poles}" for n, poles in _COUNTS.items()},
}
_STRUCTURES |= _FILTERS
_PARTS |= _FILTERS


def structure_words(structure: str) -> str:
    """Return a structure's name in plain words.

    Examples
    --------
    >>> structure_words("second_order"), structure_words("fourth_order")
    ('second order', 'fourth order')
    >>> structure_words("iir_2_zeros")
    'a filter of two poles and zeros'
    """
    return _STRUCTURES.get(structure, structure.replace("_", " "))


def headline(result: Identification) -> str:
    """Say in one sentence what came of it, the worst pair deciding.

    Examples
    --------
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> headline(Identification(record=summary, pairs=()))
    'Nothing was identified.'
    """
    if not result.pairs:
        return "Nothing was identified."
    pairs = len(result.pairs)
    if pairs == 1:
        return f"{VERDICTS[result.verdict]}: {pair_sentence(result.pairs[0])}"
    trusted = sum(pair.verdict == "ok" for pair in result.counted)
    apart = pairs - len(result.counted)
    others = "The other pair is" if apart == 1 else f"The other {apart} pairs are"
    rest = f" {others} not coupled." if apart else ""
    return (
        f"{VERDICTS[result.verdict]}: {trusted} of {len(result.counted)} pairs can be used without "
        f"reservation.{_weak(result)}{rest}"
    )


def _weak(result: Identification) -> str:
    """Name the pairs that cannot be used without reservation, and their doubtful figures."""
    said = []
    for pair in result.counted:
        bad, _ = doubtful_and_ok(pair)
        if pair.verdict == "not_identifiable":
            said.append(f"{pair.input} → {pair.output} (not identifiable)")
        elif pair.verdict == "doubtful":
            named = ", ".join(bad[:_MOST]) + (f", {len(bad) - _MOST} more" if bad[_MOST:] else "")
            said.append(f"{pair.input} → {pair.output}" + (f" ({named})" if bad else ""))
    if not said:
        return ""
    more = f"; {len(said) - _MOST} more" if said[_MOST:] else ""
    return f" Doubtful: {'; '.join(said[:_MOST])}{more}."


def doubtful_and_ok(pair: PairIdentification) -> tuple[list[str], list[str]]:
    """Figures of the model that are doubtful, and those that are not, as sentences name them."""
    given = [w for w in GLOSSARY if getattr(pair.parameters, w.name) is not None]
    # The paper's delay is what it is, whatever the model.
    given = [w for w in given if w.name != "delay_correlation"]
    verdicts = {w.inline: getattr(pair.parameters, w.name).verdict for w in given}
    bad = [name for name, verdict in verdicts.items() if verdict == "doubtful"]
    return bad, [name for name, verdict in verdicts.items() if verdict == "ok"]


def nonlinear_facts(pair: PairIdentification) -> list[tuple[str, str]]:
    """Name and value of all that is said of a nonlinearity; none where there is none to report.

    Parameters
    ----------
    pair : PairIdentification
        What was found.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hmpim.identify import Nonlinearity
    >>> from hmpim.record import Finding
    >>> found = Nonlinearity(
    ...     share=0.02, even=0.0, odd=0.02, noise=0.7, linear=0.1, nonlinear=0.2,
    ...     kinds=("friction", "backlash"))
    >>> warned = (Finding(code="nonlinear", message="…", severity="info", parameters=()),)
    >>> pair = SimpleNamespace(nonlinearity=found, warnings=warned, nonlinear_part=None)
    >>> nonlinear_facts(pair)[2]
    ('Kind', 'friction or backlash; this record does not show which')
    """
    found = pair.nonlinearity
    if found is None or not any(warning.code == "nonlinear" for warning in pair.warnings):
        return []
    kind = " or ".join(name.replace("_", " ") for name in found.kinds)
    if pair.nonlinear_part is not None:
        kind = f"{pair.nonlinear_part.kind.replace('_', ' ')}, in the model"
    elif len(found.kinds) > 1:
        kind += "; this record does not show which"
    elif found.size is not None:
        kind += f", size {format_estimate(found.size)}"
    parts = [
        ("noise", found.noise),
        ("still following the input", found.linear),
        ("nonlinear", found.nonlinear),
    ]
    return [
        ("Nonlinear part", f"{percent(found.share)} % of the output (r.m.s.)"),
        ("Odd, even", f"{percent(found.odd)} %, {percent(found.even)} %"),
        ("Kind", kind or "like none of those that are tried"),
        ("The residual's power", ", ".join(f"{100 * part:.0f} % {name}" for name, part in parts)),
    ]


def pair_sentence(pair: PairIdentification) -> str:
    """Say in one sentence what model was found and what it explains."""
    cause = leading(pair)
    if pair.verdict == "not_identifiable":
        return "no model describes the output." if cause is None else _uncapped(cause.message)
    if cause is not None and pair.parameters.scale_factor is None:
        return _uncapped(cause.message)
    model = [_dynamics(pair.structure)]
    if pair.parameters.delay is not None:
        model.append("a delay")
    verb = "explains" if len(model) == 1 and model[0].startswith(("a ", "an ")) else "explain"
    text = f"{' and '.join(model)} {verb} {pair.fit_percent:.1f} % of the output"
    if cause is not None:
        return f"{text}. {_trust(pair)}. {cause.message}"
    if pair.intersample == "sampled":
        return f"{text}, from sample to sample, as in software."
    between = INTERSAMPLE_WORDS[pair.intersample]
    return f"{text}; the input is taken as {between} between its samples."


def _dynamics(structure: str) -> str:
    """Name what a structure is made of, within a sentence.

    Examples
    --------
    >>> _dynamics("third_order_zeros"), _dynamics("two_modes")
    ('third-order dynamics with two zeros', 'two modes')
    """
    ordered = _ORDERED.fullmatch(structure)
    if ordered is not None:
        return f"{ordered['order']}-order dynamics{_ZEROS[ordered['zeros']]}"
    return _PARTS.get(structure, f"{structure_words(structure)} dynamics")


def leading(pair: PairIdentification) -> Finding | None:
    """Return the doubt that touches the most of the figures given; None where there is none."""
    given = [w.name for w in GLOSSARY if getattr(pair.parameters, w.name) is not None]
    doubts = [w for w in pair.warnings if w.severity == "doubt"]
    if pair.verdict == "ok" or not doubts:
        return None
    return max(doubts, key=lambda doubt: len(set(given) & set(doubt.parameters)))


def by_weight(warnings: Sequence[Finding]) -> list[Finding]:
    """Return doubts before remarks, each in their own order."""
    return sorted(warnings, key=lambda warning: warning.severity != "doubt")


def _trust(pair: PairIdentification) -> str:
    """Say which figures are good and which are doubtful, the shorter list by name."""
    bad, good = doubtful_and_ok(pair)
    if not bad:
        return "Every figure is reliable"
    if not good:
        return "No figure of the model is reliable"
    if len(good) < len(bad):
        return f"Only {listed(good)} {'is' if len(good) == 1 else 'are'} reliable"
    verb = "is" if len(bad) == 1 else "are"
    doubtful = listed(bad)
    return f"{doubtful[:1].upper()}{doubtful[1:]} {verb} doubtful; the other figures are reliable"


def listed(names: Sequence[str]) -> str:
    """Join names as a sentence does.

    Examples
    --------
    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _uncapped(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def paper_value(pair: PairIdentification, name: str) -> float | None:
    """Return the paper's figure for the parameter called `name`, if it has one."""
    value: float | None = getattr(pair.paper, name, None)
    return value


def remark(words: ParameterWords, estimate: Estimate | None, paper: float | None) -> str:
    """Say how the paper's figure compares with the estimate, and if it differs, why.

    Parameters
    ----------
    words : ParameterWords
        Of the parameter.
    estimate : Estimate or None
        By the joint fit.
    paper : float or None
        By the paper's steps.

    Examples
    --------
    >>> bias = next(words for words in GLOSSARY if words.name == "bias")
    >>> estimate = Estimate(value=0.6, std=0.01, ci95=(0.58, 0.62))
    >>> remark(bias, estimate, 0.61)
    'The two agree.'
    >>> remark(bias, estimate, 0.68)[:31]
    '0.08 above: equation (11) is th'
    """
    if not words.differs:
        return ""
    if paper is None:
        return "The paper's step gives no value for this record."
    if estimate is None:
        return "The chosen model has none."
    gap = paper - estimate.value
    if abs(gap) <= max(2.0 * estimate.spread, 0.002 * abs(estimate.value)):
        return "The two agree."
    return f"{abs(gap):.2g} {'above' if gap > 0 else 'below'}: {words.differs}."


def off_by(estimate: Estimate, truth: float) -> str:
    """Say how far an estimate is from a known truth, in its own standard deviations.

    Examples
    --------
    >>> off_by(Estimate(value=10.06, std=0.03, ci95=(10.0, 10.12)), 10.0)
    '+2.0 std'
    """
    if not 0.0 < estimate.spread < math.inf:
        return format_number(estimate.value - truth)
    steps = round((estimate.value - truth) / estimate.spread, 1) + 0.0  # no negative zero
    return f"{steps:+.1f} std" if steps else "0.0 std"
