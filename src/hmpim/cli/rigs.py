"""``hmpim rigs``: the rigs there are: described in files, our own kinds, and others' kinds."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hmpim.cli.files import check_files
from hmpim.cli.terminal import output_console

if TYPE_CHECKING:
    from hmpim.rigs.catalogue import NamedRig, Offered

__all__ = ["rigs"]


def rigs(
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the list as JSON.")
    ] = None,
) -> None:
    r"""List the rigs that hmpim run accepts; a broken one is listed with its fault.

    A rig is described under \[rigs.NAME] in hmpim.toml, here or in a folder above, or in the
    user's configuration folder. Other packages add kinds by the entry point hmpim.rigs.
    """
    from rich.table import Table

    from hmpim.rigs.catalogue import KINDS, named_rigs, offered_kinds

    named, offered = list(named_rigs().values()), offered_kinds()
    check_files(reads={"a list of rigs": [one.path for one in named]}, writes={"--json": json})
    table = Table("rig", "what it is", box=None, pad_edge=False)
    for one in named:
        table.add_row(one.name, _described(one))
    for kind in KINDS:
        table.add_row(kind.form, kind.words)
    for other in offered:
        table.add_row(other.name, _offered(other))
    output_console().print(table)
    if json is not None:
        from json import dumps

        from hmpim.formats.atomic import write_text

        data: dict[str, Any] = {
            "schema": "hmpim/rigs/1",
            "named": [
                {
                    "name": one.name,
                    "file": str(one.path),
                    "rig": None if one.description is None else one.description.rig,
                    "fault": one.fault or None,
                }
                for one in named
            ],
            "kinds": [{"name": k.name, "form": k.form, "words": k.words} for k in KINDS],
            "offered": [
                {"name": o.name, "package": o.package, "value": o.value, "fault": o.fault or None}
                for o in offered
            ],
        }
        write_text(json, dumps(data, indent=1) + "\n")


def _described(one: "NamedRig") -> str:
    if one.description is None:
        return f"skipped: {one.fault}"
    return f"{one.description.rig}, from {one.path}"


def _offered(other: "Offered") -> str:
    who = f" from {other.package}" if other.package else ""
    if other.fault:
        return f"skipped: {other.value}{who} is broken: {other.fault}"
    return f"{other.value}{who}"
