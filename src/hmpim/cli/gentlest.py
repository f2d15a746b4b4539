"""`hmpim gentlest`: the gentlest stimulus that gives a wanted accuracy inside limits."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hmpim.cli.files import check_files
from hmpim.cli.terminal import output_console, say
from hmpim.errors import ArgumentError, LimitsError

if TYPE_CHECKING:
    from hmpim.optimal import Family, Gentlest, TradePoint, Wish
    from hmpim.optimal.gentlest import Progress

__all__ = ["gentlest"]

NOT_MET = 1
_INFINITE = float("inf")


class What(StrEnum):
    """What is kept small."""

    PEAK_ACCELERATION = "peak_acceleration"
    RMS_ACCELERATION = "rms_acceleration"
    TRAVEL = "travel"
    DURATION = "duration"


def gentlest(
    natural_frequency: Annotated[float, typer.Option(help="Rough natural frequency, Hz.")],
    damping: Annotated[float, typer.Option(help="Rough damping ratio.")],
    noise: Annotated[float, typer.Option(help="Standard deviation of the noise, output's unit.")],
    fs: Annotated[float, typer.Option(help="Sampling rate, Hz.")],
    delay: Annotated[float, typer.Option(help="Rough pure delay, seconds.")] = 0.0,
    scale_factor: Annotated[float, typer.Option(help="Rough scale factor.")] = 1.0,
    range_: Annotated[
        tuple[float, float] | None,
        typer.Option("--range", metavar="F1 F2", help="Range of the natural frequency, Hz."),
    ] = None,
    damping_range: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="Z1 Z2", help="Range of the damping ratio."),
    ] = None,
    delay_range: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="S1 S2", help="Range of the delay, seconds."),
    ] = None,
    delay_error: Annotated[
        float, typer.Option(help="Wanted 95 % error of the delay, seconds.")
    ] = 0.005,
    frequency_error: Annotated[
        float, typer.Option(help="Wanted 95 % error, as a share of the natural frequency.")
    ] = 0.017,
    scale_error: Annotated[
        float, typer.Option(help="Wanted 95 % error, as a share of the scale factor.")
    ] = 0.02,
    damping_error: Annotated[
        float, typer.Option(help="Wanted 95 % error of the damping ratio.")
    ] = 0.04,
    amplitude: Annotated[float, typer.Option(help="Position limit, in the unit.")] = _INFINITE,
    max_rate: Annotated[float, typer.Option(help="Velocity limit, unit per second.")] = _INFINITE,
    max_acceleration: Annotated[
        float, typer.Option(help="Acceleration limit, unit per second squared.")
    ] = _INFINITE,
    max_jerk: Annotated[float, typer.Option(help="Jerk limit, unit per second cubed.")] = _INFINITE,
    unit: Annotated[str, typer.Option(help="Unit of the position, such as deg.")] = "",
    gentle: Annotated[What, typer.Option(help="What to keep small.")] = What.PEAK_ACCELERATION,
    duration: Annotated[
        float | None,
        typer.Option(
            help="Length of the record, seconds; 10 by default. With --gentle duration: the "
            "longest, 60."
        ),
    ] = None,
    family: Annotated[
        list[str] | None,
        typer.Option(help="sweep, exponential or multisine; may be repeated; all by default."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Samples as .csv, .h5, .mat or .h; specification as .toml."
        ),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option(
            "--json", metavar="FILE", help="JSON of the stimulus and its predicted errors."
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Picture of gentleness against accuracy, PNG.")
    ] = None,
) -> None:
    """Find the gentlest stimulus that gives a wanted accuracy inside limits.

    Exit code 1 if no stimulus does; the message then says what would be needed.

    Example:

    hmpim gentlest --natural-frequency 10 --damping 0.4 --delay 0.15 --range 7 14 --noise 0.1
    --fs 200 --amplitude 10 --unit deg -o s.csv --json s.json --plot trade.png
    """
    from hmpim.formats.atomic import replacing, write_text
    from hmpim.formats.stimulus_files import STIMULUS_SUFFIXES, save_stimulus
    from hmpim.optimal import FAMILIES, Accuracy, ModelRange, RoughModel
    from hmpim.optimal import gentlest as find_gentlest
    from hmpim.optimal import trade as trade_of
    from hmpim.stimulus import Limits

    check_files(writes={"--output": output, "--json": json_file, "--plot": plot})
    if output is not None and output.suffix.lower() not in STIMULUS_SUFFIXES:
        raise ArgumentError(f"--output {output} must end in one of {', '.join(STIMULUS_SUFFIXES)}")
    if plot is not None and plot.suffix.lower() != ".png":
        raise ArgumentError(f"--plot {plot} does not end in .png, the one picture made here")
    limits = Limits(
        position=amplitude,
        velocity=max_rate,
        acceleration=max_acceleration,
        jerk=max_jerk,
        unit=unit,
    )
    accuracy = Accuracy(
        delay=delay_error,
        natural_frequency=frequency_error,
        scale_factor=scale_error,
        damping_ratio=damping_error,
    )
    families: list[Family] = []
    for name in family or FAMILIES:
        known = next((f for f in FAMILIES if f == name), None)
        if known is None:
            raise ArgumentError(f"--family {name!r} is not known; use one of {', '.join(FAMILIES)}")
        families.append(known)
    points: tuple[TradePoint, ...] = ()
    try:
        with _bar("Searching") as progress:
            found = find_gentlest(
                accuracy=accuracy,
                model=RoughModel(
                    delay=delay,
                    natural_frequency=natural_frequency,
                    damping_ratio=damping,
                    scale_factor=scale_factor,
                ),
                model_range=ModelRange(
                    delay=delay_range, natural_frequency=range_, damping_ratio=damping_range
                ),
                noise_std=noise,
                limits=limits,
                fs=fs,
                gentle=gentle.value,
                duration=duration,
                families=families,
                progress=progress,
            )
    except LimitsError as refusal:
        typer.echo(f"hmpim: {refusal}", err=True)
        raise typer.Exit(NOT_MET) from None
    if plot is not None:
        with _bar("Trade") as progress:
            points = trade_of(found, progress=progress)
        from hmpim.plots.trade import trade_plot

        with replacing(plot) as place:
            trade_plot(found, points).savefig(place, dpi=150)
    if output is not None:
        save_stimulus(found.stimulus, output)
    if json_file is not None:
        text = json.dumps(_as_dict(found, points), indent=1, allow_nan=False)
        write_text(json_file, text + "\n")
    _print(found)
    for target in (output, json_file, plot):
        if target is not None:
            say(f"Written: {target}")


@contextmanager
def _bar(what: str) -> "Iterator[Progress]":
    """Progress bar on standard error, on a terminal only."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    with Progress(
        TextColumn(f"{what}: {{task.description}}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as shown:
        task = shown.add_task("", total=1.0)

        def tell(share: float, doing: str) -> None:
            shown.update(task, completed=share, description=doing)

        yield tell


def _rows(found: "Gentlest") -> list[tuple[str, str, float | None, float, float]]:
    """Parameter, unit, wanted (None if not asked for), predicted, and worst half widths at 95 %."""
    accuracy, model = found.wish.accuracy, found.wish.model
    wanted = {
        "delay": accuracy.delay,
        "natural_frequency": accuracy.natural_frequency,
        "damping_ratio": accuracy.damping_ratio,
        "scale_factor": accuracy.scale_factor,
    }
    size = {"natural_frequency": model.natural_frequency, "scale_factor": abs(model.scale_factor)}
    units = {"delay": "s", "natural_frequency": "Hz"}
    return [
        (
            name,
            units.get(name, ""),
            None if asked is None else asked * size.get(name, 1.0),
            found.errors.ci95(name),
            found.worst.ci95(name),
        )
        for name, asked in wanted.items()
    ]


def _asked(name: str, wanted: float | None, wish: "Wish") -> str:
    """What is wanted, in words; over the range where it is a share of what has a range."""
    if wanted is None:
        return "–"
    span = wish.model_range.natural_frequency
    if name == "natural_frequency" and span is not None:
        share = wanted / wish.model.natural_frequency
        return f"{share * span[0]:.3g} to {share * span[1]:.3g}"
    return f"{wanted:.3g}"


def _print(found: "Gentlest") -> None:
    from rich.table import Table

    from hmpim.plots.trade import gentle_label
    from hmpim.units import rate_label

    stimulus, unit = found.stimulus, found.wish.limits.unit
    console = output_console()
    table = Table(title="Predicted errors at 95 %", title_justify="left")
    for heading in ("parameter", "wanted", "predicted", "worst in range", "unit"):
        table.add_column(heading, justify="left" if heading in ("parameter", "unit") else "right")
    for name, of, wanted, predicted, worst in _rows(found):
        asked = _asked(name, wanted, found.wish)
        table.add_row(name.replace("_", " "), asked, f"{predicted:.3g}", f"{worst:.3g}", of)
    console.print(table)
    console.print(
        f"{found.family}, {stimulus.samples} samples at {stimulus.fs:g} Hz, "
        f"{stimulus.duration:.4g} s with leads and tail"
    )
    console.print(f"{gentle_label(found.wish.gentle, unit)}: {found.value:.4g}")
    for order, name in enumerate(("position", "velocity", "acceleration")):
        peak, limit = getattr(stimulus.peaks, name), getattr(found.wish.limits, name)
        bound = f"of {limit:g} " if limit < _INFINITE else ""
        console.print(f"peak {name:<12} {peak:>10.5g} {bound}{rate_label(unit, order)}".rstrip())
    for other in found.candidates[1:]:
        kept = "" if other.use <= 1.0 else f", {other.use:.3g} times the limits"
        console.print(f"instead, {other.family}: {other.value:.4g}{kept}")


def _as_dict(found: "Gentlest", points: "tuple[TradePoint, ...]") -> dict[str, Any]:
    from hmpim.formats.stimulus import stimulus_to_dict

    return {
        "schema": "hmpim/gentlest/1",
        "family": found.family,
        "gentle": found.wish.gentle,
        "value": found.value,
        "errors": {
            name: {"wanted_ci95": wanted, "ci95": predicted, "worst_ci95": worst, "unit": of}
            for name, of, wanted, predicted, worst in _rows(found)
        },
        "peaks": {
            name: getattr(found.stimulus.peaks, name)
            for name in ("position", "velocity", "acceleration")
        },
        "candidates": [
            {"family": c.family, "value": c.value, "use": c.use} for c in found.candidates
        ],
        "trade": [{"factor": p.factor, "value": p.value} for p in points],
        "stimulus": stimulus_to_dict(found.stimulus),
    }
