"""`hmpim validate`: a result held against a record, or against an older result."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hmpim.cli.export import read_result
from hmpim.cli.files import check_files
from hmpim.cli.reading import (
    From,
    Rate,
    Sheet,
    StampChoice,
    Stamps,
    Time,
    To,
    Unit,
    reading,
    refuse_options,
    units_of,
)
from hmpim.cli.terminal import output_console, working
from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from rich.table import Table

    from hmpim.identify import Change, Identification, Validation

__all__ = ["validate"]

NOT_MET = 1


def validate(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="JSON of `hmpim identify --json`.")
    ],
    record: Annotated[
        Path | None, typer.Argument(metavar="RECORD", help="A record it was not fitted on.")
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="OLD", help="An older result to compare with."),
    ] = None,
    fit: Annotated[
        float | None,
        typer.Option("--fit", metavar="PERCENT", help="Lowest fit of the prediction that passes."),
    ] = None,
    noise_ratio: Annotated[
        float,
        typer.Option(
            "--noise-ratio",
            metavar="R",
            help="Largest residual that passes, relative to the stated one.",
        ),
    ] = 1.2,
    chance: Annotated[
        float,
        typer.Option(
            "--chance", metavar="P", help="Lowest p-value of the residual's tests that passes."
        ),
    ] = 1e-4,
    fs: Rate = None,
    time: Time = None,
    unit: Unit = None,
    from_: From = None,
    to: To = None,
    sweep: Annotated[
        int | None,
        typer.Option(
            "--sweep", metavar="N", min=1, help="Use this one of several sweeps in a log."
        ),
    ] = None,
    stamps: StampChoice = Stamps.AUTO,
    sheet: Sheet = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")
    ] = None,
) -> None:
    """Check that a result predicts another record as well as it claims. Exit code 1 if not.

    With --against: check what has changed since an older result, beyond both error bars.
    """
    from hmpim.identify import Bounds, compare
    from hmpim.identify import validate as check

    if record is None and against is None:
        raise ArgumentError(
            "there is nothing to compare the result with; give a RECORD, or --against OLD"
        )
    if record is None:
        refuse_options(
            {
                **{"--fit": fit, "--fs": fs, "--time": time, "--unit": unit, "--from": from_},
                **{"--to": to, "--sweep": sweep, "--sheet": sheet},
                "--stamps": None if stamps is Stamps.AUTO else stamps,
            },
            "is about a record, and none is given; give a RECORD",
        )
    check_files(
        reads={"the result": result, "the record": record, "the older result": against},
        writes={"--json": json},
    )
    found = read_result(result)
    bounds = Bounds(fit_percent=fit, noise_ratio=noise_ratio, chance=chance)
    figures: dict[str, Any] = {"schema": "hmpim/validation/1", "passed": True}
    if record is not None:
        options = reading(
            start=from_,
            stop=to,
            sweep=None if sweep is None else str(sweep),
            stamps=stamps,
            sheet=sheet,
        )
        data = _read(
            record, found, {"fs": fs, "time": time, "units": units_of(unit), "options": options}
        )
        with working("Predicting"):
            validation = check(found, data, bounds=bounds)
        figures |= validation.to_dict()
        output_console().print(_checks(validation))
        for output in validation.outputs:
            for finding in output.findings:
                output_console().print(finding.message)
    if against is not None:
        changes = compare(found, read_result(against))
        changed = any(change.changed for change in changes)
        figures["passed"] = bool(figures["passed"]) and not changed
        figures["changes"] = [_plain(change) for change in changes]
        output_console().print(_changes(changes))
    output_console().print("Passed." if figures["passed"] else "Not passed.")
    if json is not None:
        from json import dumps

        from hmpim.formats.atomic import write_text

        write_text(json, dumps(figures, indent=1, allow_nan=False) + "\n")
    if not figures["passed"]:
        raise typer.Exit(NOT_MET)


def _read(record: Path, found: "Identification", how: Mapping[str, Any]) -> Any:
    """Read the channels that the result has models of."""
    from hmpim.formats import read
    from hmpim.identify import has_model

    known = [pair for pair in found.pairs if has_model(pair)]
    with working(f"Reading {record}"):
        return read(
            record,
            inputs=list(dict.fromkeys(pair.input for pair in known)) or None,
            outputs=list(dict.fromkeys(pair.output for pair in known)) or None,
            **how,
        )


def _checks(validation: "Validation") -> "Table":
    from rich.table import Table

    table = Table("Output", "Check", "Value", "Bound", "", "What it says")
    for output in validation.outputs:
        for check in output.checks:
            bounded = check.low is not None or check.high is not None
            verdict = ("met" if check.passed else "not met") if bounded else "-"
            table.add_row(
                output.output,
                check.name,
                check.text,
                check.bound,
                verdict,
                check.message,
            )
    return table


def _changes(changes: "tuple[Change, ...]") -> "Table":
    from rich.table import Table

    limit = changes[0].limit
    table = Table("Pair", "Parameter", "Old", "New", "Deviations", f"Beyond {limit:.2f}?")
    for change in changes:
        table.add_row(
            f"{change.output} from {change.input}",
            change.name,
            change.old.text,
            change.new.text,
            f"{change.deviations:+.2f}",
            "changed" if change.changed else "no",
        )
    return table


def _plain(change: "Change") -> dict[str, Any]:
    finite = abs(change.deviations) < float("inf")
    return {
        "output": change.output,
        "input": change.input,
        "name": change.name,
        "old": change.old.to_dict(),
        "new": change.new.to_dict(),
        "deviations": change.deviations if finite else None,
        "limit": change.limit,
        "changed": change.changed,
    }
