"""``hmpim run``: a stimulus played on a rig, its record in a file, and if wanted the page."""

from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.terminal import check_target, output_console, say, working
from hmpim.errors import ArgumentError

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
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Where the record goes."),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            "--log", metavar="FILE", help="Each check, arm, stop and fault with its time."
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, help="Of what is random in a simulated rig."),
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
    _check_files(
        stimulus, rig_file, {"-o": output, "--log": log, "--json": json, "--report": report}
    )
    from hmpim.experiment import RunLog
    from hmpim.experiment import run as play
    from hmpim.formats import save
    from hmpim.formats.stimulus_files import read_stimuli
    from hmpim.rigs.catalogue import find_rig, read_description

    described = None if rig_file is None else read_description(rig_file)
    found = find_rig(rig, description=described)
    stimuli = read_stimuli(stimulus)
    with RunLog(log) as events, working(f"Running {found.rig.name}"):
        record = play(found.rig, stimuli, rng=seed, limits=found.limits, log=events)
    say(
        f"{record.samples} samples of {', '.join(c.name for c in record.outputs)} in "
        f"{record.duration:g} s from {record.source}"
    )
    if output is not None:
        save(record, output)
        say(f"Record: {output}")
    if json is None and report is None:
        return
    from hmpim.cli.identify import write_result
    from hmpim.identify import identify
    from hmpim.report import print_result

    with working("Identifying"):
        result = identify(record)
    if not quiet:
        print_result(result, output_console())
    write_result(
        result, json=json, report=report, stimulus=stimuli[0] if len(stimuli) == 1 else None
    )
    for name, path in (("Result", json), ("Page", report)):
        if path is not None:
            say(f"{name}: {path}")


def _check_files(stimulus: Path, rig_file: Path | None, targets: dict[str, Path | None]) -> None:
    """Refuse, before anything moves, files that cannot be written or stand for two things."""
    from hmpim.formats.saving import suffixes_of
    from hmpim.record import Record

    taken = {path.resolve(): "the stimulus" for path in (stimulus,)}
    if rig_file is not None:
        taken[rig_file.resolve()] = "--rig-file"
    for option, path in targets.items():
        check_target(path, option)
        if path is None:
            continue
        other = taken.setdefault(path.resolve(), option)
        if other != option:
            raise ArgumentError(f"{option} {path} is {other} as well; name another file")
    output = targets["-o"]
    if output is None and targets["--json"] is None and targets["--report"] is None:
        raise ArgumentError("nothing would be kept of the run; name a file with -o")
    if output is not None and output.suffix.lower() not in suffixes_of(Record):
        raise ArgumentError(f"-o {output} must end in one of {', '.join(suffixes_of(Record))}")
