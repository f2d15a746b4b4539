"""The same test at several amplitudes: where the system is linear (Fig. 22).

A linear system has the same parameters at every amplitude. Each parameter is compared between the
levels by its error bars; those that change by more, and the direction of the change, show where the
linear range ends and why.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from hmpim.arguments import checked
from hmpim.errors import ArgumentError
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.identify import identify
from hmpim.identify.records.alike import check_channels, each_named, names_of
from hmpim.identify.result import Identification, Parameters
from hmpim.identify.result.digits import percent, plus_minus
from hmpim.identify.result.groups import BANDWIDTHS, in_words
from hmpim.identify.worth import MATERIAL, WORTH
from hmpim.model.dynamics import FILTERS, STRUCTURES
from hmpim.record import Finding, Intersample, Record
from hmpim.tables import html_table, shortened

__all__ = ["LevelComparison", "Levels", "Trend", "compare_levels", "identify_levels"]

_COMPARED = (
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    *BANDWIDTHS,
    "scale_factor",
    "delay",
)
"""Parameters that are constant in a linear system, the most informative first."""

_Level = tuple[float, Parameters]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trend:
    """How one parameter depends on the amplitude.

    Parameters
    ----------
    name : str
        Of the parameter.
    amplitudes, values, stds : tuple of float
        By rising amplitude; levels where it is not known are left out.
    probability : float
        Probability of such differences if it were the same at all levels.
    change : float
        From the smallest to the largest amplitude, relative to the value at the smallest.
    """

    name: str
    amplitudes: tuple[float, ...]
    values: tuple[float, ...]
    stds: tuple[float, ...]
    probability: float
    change: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelComparison:
    """All trends, the linear range, and findings.

    Parameters
    ----------
    amplitudes : tuple of float
        Of the levels, in the order given.
    trends : tuple of Trend
        One per parameter known at two levels or more.
    linear_up_to : float
        Largest amplitude up to which no parameter differs from its value at the smallest one by
        more than 1 % and by more than its error.
    findings : tuple of Finding
        Codes 'nonlinear', 'hardening', 'softening', 'friction'; empty if nothing changes.
    unit : str
        Of the amplitudes; empty if it is not known.
    """

    amplitudes: tuple[float, ...]
    trends: tuple[Trend, ...]
    linear_up_to: float
    findings: tuple[Finding, ...]
    unit: str = ""

    def __repr__(self) -> str:
        return f"LevelComparison({self._linear})"

    def _repr_html_(self) -> str:
        """Return a table of the trends, for notebooks."""
        levels = sorted(self.amplitudes)
        rows = []
        for trend in self.trends:
            known = zip(trend.amplitudes, trend.values, trend.stds, strict=True)
            cells = {amplitude: plus_minus(value, std) for amplitude, value, std in known}
            moved = f"{percent(trend.change)} %", f"{percent(trend.probability)} %"
            rows.append(
                [trend.name.replace("_", " "), *(cells.get(a, "–") for a in levels), *moved]
            )
        heads = [f"at {level:.4g} {self.unit}".rstrip() for level in levels]
        notes = [finding.message for finding in self.findings]
        heads = ["parameter", *heads, "change", "chance"]
        return html_table(self._linear, heads, rows, notes=notes)

    @property
    def _linear(self) -> str:
        least, most = min(self.amplitudes), max(self.amplitudes)
        levels = f"{len(self.amplitudes)} levels, {least:.4g} to {most:.4g} {self.unit}".rstrip()
        return f"{levels}; linear up to {self.linear_up_to:.4g} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Levels:
    """One test at several amplitudes; index it output first: ``levels["y", "u"].trends``.

    Parameters
    ----------
    results : tuple of Identification
        Each record by itself, in the order given.
    comparisons : tuple of LevelComparison
        One for each pair of `results[0]`.
    """

    results: tuple[Identification, ...]
    comparisons: tuple[LevelComparison, ...]

    def __getitem__(self, key: tuple[str, str] | str) -> LevelComparison:
        wanted = self.results[0][key]
        return self.comparisons[self.results[0].pairs.index(wanted)]

    def __repr__(self) -> str:
        return f"Levels({shortened([one._linear for one in self.comparisons])})"

    def _repr_html_(self) -> str:
        """Return a table for each pair, for notebooks."""
        return "\n".join(one._repr_html_() for one in self.comparisons)

    def __iter__(self) -> Iterator[LevelComparison]:
        return iter(self.comparisons)

    def __len__(self) -> int:
        return len(self.comparisons)


@checked
def identify_levels(
    records: Sequence[Record],
    *,
    amplitudes: Sequence[float] | None = None,
    intersample: Intersample | str = "auto",
    structures: Sequence[str] | None = None,
    names: Sequence[str] | None = None,
) -> Levels:
    """Identify one test at several amplitudes, and find where it stops being linear (Fig. 22).

    Parameters
    ----------
    records : sequence of Record
        Two or more, with the same channels.
    amplitudes : sequence of float, optional
        One per record, in any measure that is the same for all; if None, half the range of each
        pair's own input.
    intersample, structures
        As in `identify`. Each pair takes the structure found at the smallest amplitude at all
        levels, so that they can be compared.
    names : sequence of str, optional
        What messages call each record, such as its file; numbers from 0 by default.

    Returns
    -------
    Levels

    Raises
    ------
    ArgumentError
        For fewer than two records, or amplitudes that do not fit them.
    RecordError
        For channels that differ, and whatever `identify` refuses.

    Examples
    --------
    >>> t = np.arange(1000) / 100
    >>> sweep = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    >>> rng = np.random.default_rng(1)
    >>> def test(gain):
    ...     u = gain * sweep
    ...     y = u - 0.02 * u**3 + 0.001 * rng.standard_normal(1000)
    ...     return Record.from_arrays({"u": u}, {"y": y}, fs=100.0)
    >>> levels = identify_levels([test(0.1), test(0.5), test(2.0)], structures=["static"])
    >>> levels["y", "u"].findings[0].code, round(levels["y", "u"].linear_up_to, 1)
    ('nonlinear', 0.5)
    """
    given = tuple(records)
    if amplitudes is not None and len(amplitudes) != len(given):
        raise ArgumentError(
            f"{len(given)} records and {len(amplitudes)} amplitudes do not match; give one "
            "amplitude for each"
        )
    if len(given) < 2:
        raise ArgumentError(f"{len(given)} record has nothing to be compared with; give two")
    for amplitude in amplitudes or ():
        if not (np.isfinite(amplitude) and amplitude > 0):
            raise ArgumentError(f"amplitude {amplitude!r} is not a positive number")
    called = names_of(given, names)
    check_channels(given, called)
    linear = partial(identify, nonlinear="reported")
    alone = partial(linear, intersample=intersample, structures=structures)
    results = each_named(alone, given, called)
    comparisons = []
    for pair in results[0].pairs:
        key = (pair.output, pair.input)
        heights = [float(np.ptp(r.channel(pair.input).values)) / 2 for r in given]
        heights = heights if amplitudes is None else list(amplitudes)
        first = results[int(np.argmin(heights))][key]
        alike = []
        for record, result in zip(given, results, strict=True):
            found = result[key]
            if found.structure != first.structure and found.verdict != "not_identifiable":
                only = _only(first.structure)
                again = linear(record, intersample=first.intersample, structures=only)
                found = again[key]
            alike.append(found.parameters)
        unit = given[0].channel(pair.input).unit if amplitudes is None else ""
        comparisons.append(compare_levels(alike, heights, unit=unit))
    return Levels(results=tuple(results), comparisons=tuple(comparisons))


def _only(structure: str) -> list[str]:
    every = STRUCTURES if structure in STRUCTURES else FILTERS
    return [name for name, known in every.items() if known.name == structure]


def compare_levels(
    results: Sequence[Parameters], amplitudes: Sequence[float], *, unit: str = ""
) -> LevelComparison:
    """Compare what was identified at several amplitudes, in any order, all in one unit."""
    levels = sorted(zip(map(float, amplitudes), results, strict=True), key=lambda level: level[0])
    trends = tuple(t for t in (_trend(levels, name) for name in _COMPARED) if t is not None)
    changed = [
        t for t in trends if t.probability * len(trends) < FALSE_ALARM and abs(t.change) > WORTH
    ]
    reach = _linear_up_to(levels, trends)
    kinds = _kind({t.name: t for t in changed})
    return LevelComparison(
        amplitudes=tuple(map(float, amplitudes)),
        trends=trends,
        linear_up_to=reach,
        findings=(*_changes(changed, _linear_range(levels, reach, unit), unit), *kinds),
        unit=unit,
    )


def _changes(changed: list[Trend], where: str, unit: str) -> Iterator[Finding]:
    """Report which parameter changes most, and where a linear model is valid."""
    if not changed:
        return
    most = max(changed, key=lambda t: abs(t.change))
    yield Finding(
        code="nonlinear",
        message=f"From an amplitude of {most.amplitudes[0]:.4g} to one of "
        f"{f'{most.amplitudes[-1]:.4g} {unit}'.rstrip()}, the {in_words(most.name)} changes by "
        f"{100 * most.change:+.2g} %, more than its error explains. {where}",
        severity="doubt",
        parameters=tuple(t.name for t in changed),
    )


def _linear_range(levels: list[_Level], reach: float, unit: str) -> str:
    """Say in a sentence up to where a linear model is valid."""
    if reach == levels[0][0]:
        return "Use a linear model at the smallest amplitude only."
    end = f"{reach:.4g} {unit}".rstrip()
    same = f"Up to {end}, no parameter clearly changes by more than {100 * MATERIAL:.0f} %"
    only = "" if reach == levels[-1][0] else ": use a linear model up to there only"
    return f"{same}{only}."


def _trend(levels: list[_Level], name: str) -> Trend | None:
    """Values of one parameter, and a χ² test of whether they are equal."""
    pairs = [(amplitude, getattr(parameters, name)) for amplitude, parameters in levels]
    known = [(a, e) for a, e in pairs if e is not None and 0 < e.spread < np.inf]
    if len(known) < 2:
        return None
    values = np.array([e.value for _, e in known])
    stds = np.array([e.spread for _, e in known])
    weights = stds**-2
    mean = float(weights @ values / weights.sum())
    statistic = float(np.sum((values - mean) ** 2 * weights))
    return Trend(
        name=name,
        amplitudes=tuple(a for a, _ in known),
        values=tuple(float(v) for v in values),
        stds=tuple(float(s) for s in stds),
        probability=float(scipy.stats.chi2.sf(statistic, len(known) - 1)),
        change=float((values[-1] - values[0]) / abs(values[0])) if values[0] != 0 else 0.0,
    )


def _linear_up_to(levels: list[_Level], trends: tuple[Trend, ...]) -> float:
    """Last level before any parameter differs from its first value."""
    reach = levels[-1][0]
    for t in trends:
        for a, value, std in zip(t.amplitudes[1:], t.values[1:], t.stds[1:], strict=True):
            moved = abs(value - t.values[0])
            if moved > MATERIAL * abs(t.values[0]) and moved > 3 * float(np.hypot(std, t.stds[0])):
                before = [amplitude for amplitude, _ in levels if amplitude < a]
                reach = min(reach, before[-1])
                break
    return reach


def _kind(changed: dict[str, Trend]) -> Iterator[Finding]:
    """Report friction, which damps small motions most, or a spring, which moves the frequency."""
    frequency, damping = changed.get("natural_frequency"), changed.get("damping_ratio")
    if (
        damping is not None
        and damping.change < 0
        and (frequency is None or abs(damping.change) > 4 * abs(frequency.change))
    ):
        yield Finding(
            code="friction",
            message=f"The damping ratio falls from {damping.values[0]:.3g} to "
            f"{damping.values[-1]:.3g} as the amplitude grows, as Coulomb friction causes. "
            "Use large motions for the linear model, and put friction into it.",
            severity="info",
            parameters=("damping_ratio",),
        )
    elif frequency is not None:
        hardens = frequency.change > 0
        yield Finding(
            code="hardening" if hardens else "softening",
            message=f"The natural frequency {'rises' if hardens else 'falls'} from "
            f"{frequency.values[0]:.5g} to {frequency.values[-1]:.5g} Hz as the amplitude grows, "
            f"as with a {'hardening' if hardens else 'softening'} spring"
            f"{'' if hardens else ', or a limit on rate or torque'}. "
            "Take the value at the smallest amplitude for the linear model.",
            severity="info",
            parameters=("natural_frequency",),
        )
