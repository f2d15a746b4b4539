"""The command line: ``hmpim COMMAND``.

Exit code 0: done. 1: a check or specification is not met. 2: bad input, said in one line on
standard error. 130: stopped from the keyboard.
"""

import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from hmpim.cli.batch import batch
from hmpim.cli.campaign import campaign
from hmpim.cli.channels import channels
from hmpim.cli.complete import completing_at_the_first_tab
from hmpim.cli.compress import compress
from hmpim.cli.demo import demo
from hmpim.cli.design import design
from hmpim.cli.export import export
from hmpim.cli.gentlest import gentlest
from hmpim.cli.identify import identify
from hmpim.cli.montecarlo import montecarlo
from hmpim.cli.paper import paper
from hmpim.cli.report import report
from hmpim.cli.rigs import rigs
from hmpim.cli.run import run
from hmpim.cli.runs import runs
from hmpim.cli.table import table
from hmpim.cli.validate import validate
from hmpim.cli.workbench import workbench
from hmpim.errors import HmpimError

__all__ = ["app", "main"]

BAD_INPUT = 2
INTERRUPTED = 130


class CommandGroup(TyperGroup):
    """Commands whose failures are one line, with no traceback."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,  # the signature is Typer's
    ) -> Any:
        """Run; turn what is wrong with the input into a line and an exit code."""
        try:
            code = super().main(
                args=args,
                prog_name=prog_name,
                complete_var=complete_var,
                standalone_mode=False,
                windows_expand_args=windows_expand_args,
                **extra,
            )
        except (HmpimError, OSError) as error:
            code = _failed(_described(error))
        except (KeyboardInterrupt, typer.Abort):
            code = INTERRUPTED
        except Exception as error:
            if not hasattr(error, "format_message"):  # a defect, not bad input: show it whole
                raise
            code = _failed(_usage(error, sys.argv[1:] if args is None else args))
        code = code if isinstance(code, int) else 0
        if not standalone_mode:
            return code
        sys.exit(code)


def _failed(message: str) -> int:
    print(f"hmpim: {' '.join(message.split())}", file=sys.stderr)
    return BAD_INPUT


def _described(error: Exception) -> str:
    """One line for an error; an operating system's with the file it is about."""
    if isinstance(error, OSError) and error.strerror:
        about = f"{error.filename}: " if error.filename else ""
        return f"{about}{error.strerror}"
    return str(error) or type(error).__name__


def _usage(error: Any, arguments: Sequence[str]) -> str:
    """One line for a mistake on the command line: the bad value, and where to read on."""
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else "hmpim"
    message = error.format_message().rstrip().rstrip(".")
    given = _given(getattr(error, "param", None), arguments)
    if given is not None and given not in message:
        message = f"{message} (it is {given!r})"
    return f"{message}; see {path} --help"


def _given(parameter: Any, arguments: Sequence[str]) -> str | None:
    """Return what stands after an option on the command line, if the mistake is in one."""
    count = max(getattr(parameter, "nargs", 1), 1)
    for option in getattr(parameter, "opts", ()):
        for place, word in enumerate(arguments):
            if word == option and place + 1 < len(arguments):
                return " ".join(arguments[place + 1 : place + 1 + count])
            if word.startswith(f"{option}="):
                return word.removeprefix(f"{option}=")
    return None


app = typer.Typer(
    name="hmpim",
    cls=CommandGroup,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"hmpim {version('hmpim')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _start(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """One short, safe excitation; every parameter of a model; an error bar on each.

    Start with: hmpim demo
    """
    if context.invoked_subcommand is None:
        print(context.get_help())


# Add a command here: its module imports what is heavy inside the function, so that
# ``hmpim --help`` stays quick.
app.command()(design)
app.command(epilog="Example: hmpim identify test.csv --input u --output y --report r.html")(
    identify
)
app.command(epilog="Example: hmpim report r.json -o r.pdf --sign sheet.pdf --operator 'M. Ohm'")(
    report
)
app.command(epilog="Example: hmpim channels test.csv --report channels.html")(channels)
app.command(epilog="Example: hmpim compress day1.csv day2.csv --input u --output y -o unit.h5")(
    compress
)
app.command(epilog="Example: hmpim runs out --where 'verdict = ok' --compare")(runs)
app.command(epilog="Example: hmpim run --rig bench s.csv -o run.csv --report r.html")(run)
app.command(epilog="Example: hmpim rigs --json rigs.json")(rigs)
app.command(epilog="Example: hmpim table --udp 127.0.0.1:5005 --rate 1000")(table)
app.command(epilog="Example: hmpim demo --out out/demo --seed 7")(demo)
app.command(epilog="Example: hmpim campaign section_v_reduced --out out/study")(campaign)
app.command(epilog="Example: hmpim batch records/ --input u --output y --out out/fleet")(batch)
app.command(epilog="Example: hmpim montecarlo field --draws 100 --out out/field")(montecarlo)
app.command()(gentlest)
app.command(epilog="Example: hmpim workbench --rig table --runs runs")(workbench)
app.command(epilog="Example: hmpim export r.json --to c -o model/")(export)
app.command(epilog="Example: hmpim validate r.json second.csv --fit 90")(validate)
app.command(epilog="Example: hmpim paper --out out/paper --figures 12 13")(paper)


def main() -> None:
    """Run the command line; this is what ``hmpim`` starts."""
    completing_at_the_first_tab()
    app()


if __name__ == "__main__":
    main()
