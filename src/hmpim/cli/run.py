"""``hmpim run``: a stimulus played on a rig, its record in a file, and if wanted the page."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.cli.complete import complete_rig
from hmpim.cli.files import check_files
from hmpim.cli.paging import check_paper
from hmpim.cli.stages import Stages
from hmpim.cli.terminal import output_console, say, warn, working
from hmpim.errors import ArgumentError, HmpimError, RigError

if TYPE_CHECKING:
    from hmpim.cli.strip import Strip
    from hmpim.experiment import RunLog
    from hmpim.report.figures import Picture
    from hmpim.rigs import Rig
    from hmpim.rigs.catalogue import Description
    from hmpim.stimulus import Stimulus

__all__ = ["run"]


def run(
    stimulus: Annotated[
        Path,
        typer.Argument(
            metavar="STIMULUS",
            help="What to play, as hmpim design saves it: .csv, .toml, .h5, .mat or .h.",
        ),
    ],
    rig: Annotated[
        str,
        typer.Option(
            "--rig",
            metavar="RIG",
            autocompletion=complete_rig,
            help="Name from hmpim.toml, or a kind such as sensor, table; see hmpim rigs.",
        ),
    ] = "",
    rig_file: Annotated[
        Path | None,
        typer.Option(
            "--rig-file",
            metavar="FILE",
            help="TOML that describes the rig: address, rate, axes, units, limits, load.",
        ),
    ] = None,
    axis: Annotated[
        str,
        typer.Option("--axis", metavar="NAME", help="Axis to move, if the stimulus names none."),
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="File for the record, written during the run. After a kill, the samples are in "
            "this file if it is .h5, otherwise in FILE.partial.h5.",
        ),
    ] = None,
    until: Annotated[
        str,
        typer.Option(
            "--until",
            metavar="RULE",
            help="End as soon as these standard deviations are reached: "
            "delay=0.4ms,natural_frequency=1%.",
        ),
    ] = "",
    pair: Annotated[
        tuple[str, str] | None,
        typer.Option(
            "--pair",
            metavar="OUTPUT INPUT",
            help="Output and input that --until refers to, if several channels are recorded.",
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            "--log", metavar="FILE", help="Write each check, arming, stop and fault with its time."
        ),
    ] = None,
    watchdog: Annotated[
        bool,
        typer.Option(
            "--watchdog/--no-watchdog",
            help="Refuse a rig that nothing would stop if this process were killed. "
            "--no-watchdog: a separate process drives the rig, and stops it if this one is killed.",
        ),
    ] = True,
    feel: Annotated[
        bool | None,
        typer.Option(
            "--feel/--no-feel",
            help="Begin with a small motion, and raise the level in steps. On by default for a "
            "rig that states no limits of its own.",
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live/--no-live", help="Draw the run in the terminal.")
    ] = True,
    tick: Annotated[
        str,
        typer.Option(
            "--tick",
            metavar="SOURCE",
            help="External tick that drives the run: udp://HOST:PORT or serial:PORT.",
        ),
    ] = "",
    tick_rate: Annotated[
        float, typer.Option("--tick-rate", metavar="HZ", help="Pulses of the tick per second.")
    ] = 1000.0,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, help="Seed of everything random in a simulated rig."),
    ] = None,
    json: Annotated[
        Path | None,
        typer.Option("--json", metavar="FILE", help="Identify, and write the result as JSON."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="Identify, and write one HTML page."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no table.")] = False,
) -> None:
    """Play a stimulus on a rig, safely, and record what went in and what came out.

    Limits are checked before anything moves, and the rig is stopped whatever happens.
    """
    check_files(
        reads={"the stimulus": stimulus, "the rig's file": _files_of(rig, rig_file)},
        writes={"-o": output, "--log": log, "--json": json, "--report": report},
    )
    _check_kept(output, json=json, report=report)
    from hmpim.experiment import Feel, RunLog, RunOptions, until_of
    from hmpim.experiment import run as play
    from hmpim.formats.stimulus_files import read_stimuli
    from hmpim.rigs import TickClock, find_ticks
    from hmpim.rigs.catalogue import check_described, find_rig, read_description

    rule = until_of(until, pair=pair) if until else None
    if pair is not None and rule is None:
        raise ArgumentError(f"--pair {pair[0]} {pair[1]} belongs to --until; give a rule too")
    described = None if rig_file is None else read_description(rig_file)
    found = find_rig(rig, description=described)
    stimuli = _aimed(read_stimuli(stimulus), axis, found.description.axes)
    check_described(stimuli, found)
    clock = TickClock(find_ticks(tick), rate=tick_rate) if tick else None
    options = RunOptions(
        clock=clock,
        watchdog=watchdog and found.description.watchdog is None,
        feel="unknown" if feel is None else Feel() if feel else None,
    )
    unit = found.rig if watchdog else _driven(found.rig, rig, described)
    stages = Stages()
    with clock or nullcontext(), RunLog(log) as events, _kept_is_said(events), stages.stage("run"):
        record = play(
            unit,
            stimuli,
            path=output,
            rng=seed,
            limits=found.limits,
            until=rule,
            subscribers=_watching(live=live),
            log=events,
            options=options,
        )
    say(
        f"{record.samples} samples of {', '.join(c.name for c in record.outputs)} in "
        f"{record.duration:g} s from {record.source or found.rig.name}"
    )
    if record.stopping is not None:
        stopped = record.stopping
        say(
            f"Sure after {stopped.time:.3g} s and {stopped.looks} looks ({stopped.rule}); "
            f"{stopped.saved:.3g} s saved"
        )
    elif rule is not None:
        say(f"Played to its end: the rule was not met before ({rule})")
    if output is not None:
        say(f"Record: {output}")
    if json is None and report is None:
        return
    from hmpim.cli.identify import write_result
    from hmpim.identify import identify
    from hmpim.report import print_result

    with working("Identifying"), stages.stage("identification"):
        result = identify(record)
    if not quiet:
        print_result(result, output_console())
    with stages.stage("page" if report is not None else "result"):
        write_result(
            result,
            json=json,
            report=report,
            stimulus=stimuli[0] if len(stimuli) == 1 else None,
            pictures=() if report is None else _pictures(found.rig),
        )
    for name, path in (("Result", json), ("Page", report)):
        if path is not None:
            say(f"{name}: {path}")
    say(stages.words())


def _aimed(stimuli: "list[Stimulus]", axis: str, axes: tuple[str, ...]) -> "list[Stimulus]":
    """Give a stimulus that names no axis the one that is asked for, or the only one described."""
    from dataclasses import replace

    if not axis and len(axes) == 1 and len(stimuli) == 1 and not stimuli[0].axis:
        axis = axes[0]
    if not axis:
        return stimuli
    if len(stimuli) > 1 or stimuli[0].axis not in ("", axis):
        named = ", ".join(one.axis for one in stimuli)
        raise ArgumentError(f"--axis {axis}: the stimulus is for {named} already; leave it out")
    return [replace(stimuli[0], axis=axis)]


def _driven(found: "Rig", text: str, description: "Description | None") -> "Rig":
    """Return the rig in a process of its own, if it moves."""
    from hmpim.experiment import OutlivingRig
    from hmpim.experiment.checks import moves

    return OutlivingRig(_again, text, description) if moves(found) else found


def _again(text: str, description: "Description | None") -> "Rig":
    """Make the rig once more, in the process that drives it."""
    from hmpim.rigs.catalogue import find_rig

    return find_rig(text, description=description).rig


@contextmanager
def _kept_is_said(log: "RunLog") -> Iterator[None]:
    """Say what there is of a run that was broken off, by a signal or by an error.

    Software under test that calls sys.exit does not choose the exit code: that is an error too.
    """
    from hmpim.experiment.interrupt import AskedToEnd

    try:
        yield
    except (KeyboardInterrupt, AskedToEnd) as ended:
        cause = "Ctrl-C" if isinstance(ended, KeyboardInterrupt) else str(ended)
        warn("; ".join((f"stopped by {cause}", *(_kept(log) or ["nothing was kept"]))))
        raise
    except SystemExit as error:
        message = f"the rig called sys.exit({error.code!r}); make it return, or raise an error"
        raise RigError("; ".join((message, *_kept(log)))) from error
    except HmpimError as error:
        raise type(error)("; ".join((str(error), *_kept(log)))) from error


def _kept(log: "RunLog") -> list[str]:
    return [event.message for event in log.events if event.kind == "kept"]


def _watching(*, live: bool) -> list["Strip"]:
    """Subscribers: the strip, where there is a terminal that can draw it."""
    from rich.console import Console

    from hmpim.cli.strip import Strip

    drawing = live and Console(stderr=True).is_terminal and "utf" in (sys.stderr.encoding or "")
    return [Strip(sys.stderr)] if drawing else []


def _files_of(rig: str, rig_file: Path | None) -> list[Path]:
    """Files that say what the rig is: its own, those with named rigs, and code."""
    from hmpim.rigs.catalogue.named import config_files

    own = [] if rig_file is None else [rig_file]
    code = [Path(part) for part in rig.split(":")[1:] if Path(part).is_file()]
    return [*own, *config_files(), *code]


def _pictures(rig: "Rig") -> "list[Picture]":
    """What a camera saw, if the rig has one."""
    from hmpim.report.frames import frames_picture

    frames = getattr(rig, "frames", ())
    return [frames_picture(frames)] if frames else []


def _check_kept(output: Path | None, *, json: Path | None, report: Path | None) -> None:
    """Refuse, before anything moves, a run of which nothing is kept, or can be written."""
    from hmpim.formats.saving import suffixes_of
    from hmpim.record import Record

    check_paper(report)
    if json is not None and json.suffix.lower() != ".json":
        raise ArgumentError(f"--json {json} must end in .json")
    if output is None and json is None and report is None:
        raise ArgumentError("the run would not be saved; name a file with -o")
    if output is not None and output.suffix.lower() not in suffixes_of(Record):
        raise ArgumentError(f"-o {output} must end in one of {', '.join(suffixes_of(Record))}")
