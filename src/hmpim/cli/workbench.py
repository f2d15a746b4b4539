"""``hmpim workbench``: the whole job in a browser."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.complete import complete_rig
from hmpim.cli.terminal import say
from hmpim.errors import ArgumentError

__all__ = ["workbench"]


def workbench(
    runs: Annotated[
        Path,
        typer.Option(
            "--runs", metavar="DIR", help="Folder of the runs; everything is written there."
        ),
    ] = Path("runs"),
    port: Annotated[
        int, typer.Option("--port", metavar="N", help="Where to listen; 0: any free port.")
    ] = 0,
    rig: Annotated[
        list[str] | None,
        typer.Option(
            "--rig",
            metavar="RIG",
            autocompletion=complete_rig,
            help="A rig to offer in addition to those of hmpim.toml; may be repeated.",
        ),
    ] = None,
    rig_file: Annotated[
        Path | None,
        typer.Option("--rig-file", metavar="FILE", help="TOML that describes one more rig."),
    ] = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open it in the browser.")
    ] = True,
    max_upload: Annotated[
        float,
        typer.Option(
            "--max-upload", metavar="MB", help="Largest file that may be dropped on a page."
        ),
    ] = 2000.0,
    grace: Annotated[
        float,
        typer.Option(
            "--grace",
            metavar="S",
            help="Seconds after which a run ends once the window that armed its rig is gone.",
        ),
    ] = 5.0,
) -> None:
    """Open the workbench: design, check, run, analyse, compare and campaigns in a browser.

    It listens on this computer alone. The address holds a token: whoever has it may move the rigs.
    """
    from hmpim.rigs.catalogue import check_rig, read_description
    from hmpim.workbench import Settings
    from hmpim.workbench.server import Address, serve

    if not 0 <= port <= 65535:
        raise ArgumentError(f"--port {port} is not a port; give 0 to 65535")
    if not max_upload > 0.0:
        raise ArgumentError(f"--max-upload {max_upload:g} MB allows no file; give a positive size")
    if not 0.0 < grace <= 60.0:
        raise ArgumentError(f"--grace {grace:g} s must be more than 0 and at most 60")
    if rig_file is not None:
        read_description(rig_file)

    for name in rig or ():
        check_rig(name)

    def ready(address: Address) -> None:
        say(f"Workbench at {address.url}")
        say(f"Runs in {runs.resolve()}; Ctrl-C ends it")
        sys.stdout.flush()

    settings = Settings(
        runs=runs,
        rigs=tuple(rig or ()),
        rig_file=rig_file,
        port=port,
        largest=round(1e6 * max_upload),
        grace=grace,
    )
    serve(settings, ready=ready, browser=browser)
    say("Workbench ended")
