"""``hmpim channels``: what a file holds, with a picture of each channel and a proposal."""

from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.reading import Rate, Sheet, StampChoice, Stamps, Time, say_broken_readers
from hmpim.cli.terminal import output_console, working

__all__ = ["channels"]


def channels(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A record of any known format.")],
    time: Time = None,
    fs: Rate = None,
    sheet: Sheet = None,
    stamps: StampChoice = Stamps.AUTO,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write what is found as JSON.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="Write a page with a picture of each."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no table.")] = False,
) -> None:
    """List the channels of a file: unit, rate, span, gaps; propose inputs and outputs."""
    check_files(reads={"the file": [file]}, writes={"--json": json, "--report": report})

    from json import dumps

    from hmpim.formats.atomic import write_text
    from hmpim.formats.readers import Layout
    from hmpim.formats.survey import survey
    from hmpim.report.channels import channels_page, print_channels, survey_to_dict

    say_broken_readers()
    layout = Layout(time=time, fs=fs, stamps=stamps.value, sheet=sheet)
    with working(f"Reading {file}"):
        found = survey(file, layout=layout)
    if not quiet:
        print_channels(found, output_console(), path=str(file))
    if json is not None:
        write_text(json, dumps(survey_to_dict(found), indent=1, allow_nan=False) + "\n")
    if report is not None:
        with working("Drawing the page"):
            channels_page(found, report, source=str(file))
