"""`hmpim design`: a stimulus inside limits, as a file for the rig and JSON for the record."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from hmpim.cli.files import check_files
from hmpim.errors import ArgumentError
from hmpim.stimulus.kinds import KINDS, Kind
from hmpim.stimulus.limits import QUANTITIES

__all__ = ["design"]


def _number_or_auto(option: str, text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError:
        raise ArgumentError(f"{option} {text!r} is neither 'auto' nor a number") from None


def _known_kind(text: str) -> Kind:
    for kind in KINDS:
        if text == kind:
            return kind
    raise ArgumentError(f"--kind {text!r} must be one of {', '.join(KINDS)}")


def _known_base(text: str) -> Literal["auto"] | None:
    if text == "auto":
        return "auto"
    if text == "none":
        return None
    raise ArgumentError(f"--base {text!r} must be auto or none")


def design(
    band: Annotated[
        tuple[float, float],
        typer.Option(metavar="F1 F2", help="First and last frequency, Hz."),
    ],
    duration: Annotated[float, typer.Option(help="Length of the sweep, seconds.")],
    fs: Annotated[float, typer.Option(help="Sampling rate, Hz.")],
    amplitude: Annotated[float, typer.Option(help="Position limit, in the unit.")],
    max_rate: Annotated[float, typer.Option(help="Velocity limit, unit per second.")] = float(
        "inf"
    ),
    max_acceleration: Annotated[
        float, typer.Option(help="Acceleration limit, unit per second squared.")
    ] = float("inf"),
    max_jerk: Annotated[
        float, typer.Option("--max-jerk", help="Jerk limit, unit per second cubed.")
    ] = float("inf"),
    jerk: Annotated[float | None, typer.Option("--jerk", hidden=True)] = None,
    kind: Annotated[
        str, typer.Option(metavar="KIND", help=f"Waveform: {', '.join(KINDS)}.")
    ] = "hmpim",
    sweep: Annotated[
        float | None,
        typer.Option(metavar="S", help="Length of each sweep of kind repeated, seconds."),
    ] = None,
    extinction: Annotated[
        str, typer.Option(metavar="auto|N", help="Extinction factor n; auto: the smallest.")
    ] = "auto",
    lead: Annotated[
        str,
        typer.Option(
            metavar="auto|0|S",
            help="Seconds to accelerate from rest, and to return to it; 0: the paper's waveform.",
        ),
    ] = "auto",
    tail: Annotated[
        str, typer.Option(metavar="auto|S", help="Seconds at rest appended at the end.")
    ] = "auto",
    base: Annotated[
        str,
        typer.Option(
            metavar="auto|none",
            help="auto: add a slow back-and-forth motion to the waveform, against stiction.",
        ),
    ] = "none",
    unit: Annotated[str, typer.Option(help="Unit of the position, such as deg.")] = "",
    resolution: Annotated[
        float, typer.Option(help="Smallest step of the rig's position command; 0: none.")
    ] = 0.0,
    wanted_snr: Annotated[
        float | None,
        typer.Option(
            help="Refuse a design with a lower signal-to-noise ratio at any frequency, dB."
        ),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(help="Standard deviation of the noise in each sample, in the unit."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random phases.")] = 0,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Samples as .csv, .h5, .mat or .h; specification as .toml; C99 for a target that "
            "computes the samples itself as .c.",
        ),
    ] = None,
    json_file: Annotated[
        Path | None,
        typer.Option(
            "--json", metavar="FILE", help="Write gain, extinction, peaks and more as JSON."
        ),
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Picture of the time histories, PNG.")] = None,
) -> None:
    """Design a stimulus inside position, rate and acceleration limits.

    The amplitude is set to its limit, then the extinction factor is raised until rate and
    acceleration are within theirs. The axis starts and ends at rest. The spectrum of a
    multisine follows the limits; binary sequences and steps move smoothly between levels.

    Example:

    hmpim design --band 0.1 10 --duration 10 --fs 500 --amplitude 10 --max-rate 1000
    --max-acceleration 40000 --unit deg -o s.csv --json s.json
    """
    from hmpim.formats.atomic import replacing
    from hmpim.formats.stimulus import save_stimulus_json
    from hmpim.formats.stimulus_files import STIMULUS_SUFFIXES, save_stimulus
    from hmpim.stimulus import Limits
    from hmpim.stimulus import design as design_stimulus
    from hmpim.units import rate_label

    check_files(writes={"--output": output, "--json": json_file, "--plot": plot})
    if output is not None and output.suffix.lower() not in STIMULUS_SUFFIXES:
        raise ArgumentError(f"--output {output} must end in one of {', '.join(STIMULUS_SUFFIXES)}")
    if plot is not None and plot.suffix.lower() != ".png":
        raise ArgumentError(f"--plot {plot} does not end in .png, the one picture made here")
    if jerk is not None and max_jerk < float("inf"):
        raise ArgumentError("--jerk is the old name of --max-jerk; give --max-jerk alone")
    limits = Limits(
        position=amplitude,
        velocity=max_rate,
        acceleration=max_acceleration,
        jerk=max_jerk if jerk is None else jerk,
        unit=unit,
    )
    stimulus = design_stimulus(
        band=band,
        duration=duration,
        fs=fs,
        limits=limits,
        kind=_known_kind(kind),
        sweep=sweep,
        extinction=_number_or_auto("--extinction", extinction),
        lead=_number_or_auto("--lead", lead),
        tail=_number_or_auto("--tail", tail),
        base=_known_base(base),
        resolution=resolution,
        rng=seed,
        wanted_snr=wanted_snr,
        noise=noise,
    )
    if output is not None:
        save_stimulus(stimulus, output)
    if json_file is not None:
        save_stimulus_json(stimulus, json_file)
    if plot is not None:
        from hmpim.plots import time_histories

        with replacing(plot) as place:
            time_histories(stimulus).savefig(place, dpi=150)
    typer.echo(
        f"{stimulus.samples} samples at {stimulus.fs:g} Hz, {stimulus.duration:g} s, "
        f"of which the waveform {stimulus.sweep_duration:g} s from {stimulus.sweep_start:g} s"
    )
    if stimulus.gain is not None and stimulus.extinction is not None:
        typer.echo(f"gain {stimulus.gain:.6g}, extinction n = {stimulus.extinction:g}")
    for order, name in enumerate(QUANTITIES if limits.jerk < float("inf") else QUANTITIES[:3]):
        peak, limit = getattr(stimulus.peaks, name), getattr(limits, name)
        bound = f"of {limit:g} " if limit < float("inf") else ""
        typer.echo(f"peak {name:<12} {peak:>10.5g} {bound}{rate_label(unit, order)}".rstrip())
