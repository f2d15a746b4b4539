"""Several records of one test on a terminal: averages, repeatability, dependence on level."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hmpim.identify import Estimate, PairIdentification
from hmpim.identify.records.levels import LevelComparison, Levels, Trend
from hmpim.identify.records.repeated import RepeatedPair, Repeats
from hmpim.identify.result.digits import percent
from hmpim.plots.style import printable
from hmpim.record import Finding
from hmpim.report.numbers import format_estimate, format_scatter, format_value, plus_minus
from hmpim.report.text import finding_line
from hmpim.report.words import GLOSSARY, by_weight

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

__all__ = [
    "level_cells",
    "linear_words",
    "marked_value",
    "percent_words",
    "print_levels",
    "print_repeats",
    "repeats_table",
]


_POSITIVE = {words.name for words in GLOSSARY if words.positive}


def repeats_table(pair: RepeatedPair) -> "Table":
    """Return what the repeats say of one pair as a table for a terminal.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.identify import Estimate, FrequencyResponse
    >>> from hmpim.identify.records.repeated import RepeatedParameter
    >>> none = np.empty(0)
    >>> mean = Estimate(value=0.15, std=0.0001, ci95=(0.1498, 0.1502), unit="s")
    >>> delay = RepeatedParameter(
    ...     name="delay", mean=mean, values=(0.1499, 0.1501), repeatability=0.00014,
    ...     chi_squared=1.0, freedom=1, probability=0.32, agree=True)
    >>> pair = RepeatedPair(
    ...     input="u", output="y", structures=("static", "static"), parameters=(delay,),
    ...     frequency_response=FrequencyResponse(frequency=none, response=none, std=none),
    ...     response_scatter=1.0, noise_std=None, unmodelled=None, unmodelled_probability=None,
    ...     findings=())
    >>> [str(next(column.cells)) for column in repeats_table(pair).columns]
    ['Delay, pure', '0.15000 ± 0.00010', 's', '0.00014', '1.00', '32 %', 'yes', 'ok']
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("Parameter")
    for heading in ("Mean ± std", "Unit", "Repeatability", "Scatter / stated", "Chance"):
        table.add_column(heading, justify="left" if heading == "Unit" else "right")
    table.add_column("Error bars agree")
    table.add_column("Verdict")
    found = {parameter.name: parameter for parameter in pair.parameters}
    for words in GLOSSARY:
        parameter = found.get(words.name)
        if parameter is None:
            continue
        ratio = (parameter.chi_squared / parameter.freedom) ** 0.5
        cells = (
            words.label,
            format_value(parameter.mean, positive=words.positive),
            parameter.mean.unit,
            format_scatter(parameter.repeatability, parameter.mean.value),
            f"{ratio:.2f}",
            percent_words(parameter.probability),
            "yes" if parameter.agree else "no",
            parameter.mean.verdict,
        )
        table.add_row(*(Text(cell) for cell in cells))
    return table


def print_repeats(repeats: Repeats, console: "Console") -> None:
    """Print, for each pair, the averages and whether the stated errors agree with the scatter.

    Parameters
    ----------
    repeats : Repeats
        From `hmpim.identify_repeats`.
    console : rich.console.Console
        Where to.

    Examples
    --------
    >>> from rich.console import Console
    >>> print_repeats(Repeats(results=(), pairs=()), Console())
    0 records of one stimulus
    """
    from rich.text import Text

    count = len(repeats.results)
    console.print(Text(f"{count} records of one stimulus", style="bold"))
    for pair in repeats.pairs:
        console.print(Text(printable(f"{pair.input} → {pair.output}"), style="bold"))
        if not pair.parameters:
            console.print(Text("No parameter is determined by two records or more."))
        else:
            console.print(repeats_table(pair))
        if pair.noise_std is not None:
            console.print(
                Text(
                    f"Noise, from what differs between the records: "
                    f"{printable(format_estimate(pair.noise_std))}"
                )
            )
        _print_findings(pair.findings, console)


def print_levels(levels: Levels, names: Sequence[str], console: "Console") -> None:
    """Print how each parameter depends on the amplitude, and the linear range.

    Parameters
    ----------
    levels : Levels
        From `hmpim.identify.identify_levels`.
    names : sequence of str
        Of the records, in the order given.
    console : rich.console.Console
        Where to.
    """
    from rich.text import Text

    console.print(Text(f"{len(names)} records of one stimulus at several levels", style="bold"))
    for pair, compared in zip(levels.results[0].pairs, levels.comparisons, strict=True):
        console.print(Text(printable(f"{pair.input} → {pair.output}"), style="bold"))
        unit = compared.unit
        if compared.trends:
            order = sorted(range(len(names)), key=lambda k: compared.amplitudes[k])
            each = [levels.results[k][pair.output, pair.input] for k in order]
            console.print(_trend_table(compared, each))
            words = linear_words(compared, unit)
            console.print(Text(f"{words[:1].upper()}{words[1:]}."))
        else:
            console.print(Text("No parameter is determined at two levels or more."))
        _print_findings(compared.findings, console)


def linear_words(compared: LevelComparison, unit: str) -> str:
    """Say over which amplitudes a pair is linear.

    Examples
    --------
    >>> def found(end):
    ...     return LevelComparison(
    ...         amplitudes=(1.0, 4.0, 2.0), trends=(), linear_up_to=end, findings=())
    >>> linear_words(found(4.0), "deg")
    'linear at all amplitudes, from 1 to 4 deg'
    >>> linear_words(found(2.0), ""), linear_words(found(1.0), "V")
    ('linear up to an amplitude of 2', 'not linear above an amplitude of 1 V')
    """
    least, most = (f"{end(compared.amplitudes):.4g}" for end in (min, max))
    up_to = f"{compared.linear_up_to:.4g}"
    if up_to == most:
        said = f"linear at all amplitudes, from {least} to {most}"
    elif up_to == least:
        said = f"not linear above an amplitude of {least}"
    else:
        said = f"linear up to an amplitude of {up_to}"
    return f"{said} {unit}".rstrip()


def marked_value(estimate: Estimate | None, name: str) -> str:
    """Write a parameter's value with its error, a doubtful one with a question mark.

    Examples
    --------
    >>> marked_value(Estimate(value=0.4, std=None, ci95=None, verdict="doubtful"), "damping_ratio")
    '0.4 ± ?'
    """
    if estimate is None:
        return "–"
    shown = format_value(estimate, positive=name in _POSITIVE)
    return shown if estimate.verdict == "ok" or shown.endswith("?") else f"{shown} ?"


def level_cells(
    trend: Trend, each: Sequence[PairIdentification], amplitudes: Sequence[float]
) -> list[str]:
    """Write one parameter at each level, as compared: by one structure at all of them.

    Parameters
    ----------
    trend : Trend
        Of the parameter.
    each : sequence of PairIdentification
        The pair at each level, by rising amplitude.
    amplitudes : sequence of float
        Of all levels, rising.
    """
    own = [getattr(pair.parameters, trend.name) for pair in each]
    alike = [pair.structure == each[0].structure for pair in each]
    kept = {e.value for e, same in zip(own, alike, strict=True) if same and e is not None}
    # Found once more, by the structure of the smallest amplitude.
    again = {
        amplitude: plus_minus(value, std)
        for amplitude, value, std in zip(trend.amplitudes, trend.values, trend.stds, strict=True)
        if value not in kept
    }
    return [
        marked_value(estimate, trend.name) if same else again.get(amplitude, "–")
        for amplitude, estimate, same in zip(amplitudes, own, alike, strict=True)
    ]


def _trend_table(compared: LevelComparison, each: Sequence[PairIdentification]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    labels = {words.name: words.label for words in GLOSSARY}
    amplitudes, unit = sorted(compared.amplitudes), compared.unit
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("Parameter, at amplitude" + (f" ({printable(unit)})" if unit else ""))
    for amplitude in amplitudes:
        table.add_column(f"{amplitude:.4g}", justify="right")
    table.add_column("Change", justify="right")
    table.add_column("Chance", justify="right")
    for trend in compared.trends:
        cells = [
            labels.get(trend.name, trend.name),
            *level_cells(trend, each, amplitudes),
            f"{'+' if trend.change > 0 else ''}{percent(trend.change)} %",
            percent_words(trend.probability),
        ]
        table.add_row(*(Text(cell) for cell in cells))
    return table


def _print_findings(findings: Sequence[Finding], console: "Console") -> None:
    for finding in by_weight(findings):
        console.print(finding_line(finding))


def percent_words(probability: float) -> str:
    """Chance in per cent.

    Examples
    --------
    >>> percent_words(1.0), percent_words(0.0432), percent_words(1e-9)
    ('100 %', '4.3 %', '< 0.1 %')
    """
    if probability < 0.001:
        return "< 0.1 %"
    places = 1 if probability < 0.1 else 0
    return f"{100 * probability:.{places}f} %"
