"""Options that say who does the work of many records."""

from typing import Annotated

import typer

__all__ = ["Scheduler", "Workers"]

Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="tcp://HOST:PORT", help="A Dask scheduler to use."),
]
Workers = Annotated[
    int | None,
    typer.Option(
        "--workers", metavar="N", help="Processes on this computer; 0: work in this process."
    ),
]
