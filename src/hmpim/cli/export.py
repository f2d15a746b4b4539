"""`hmpim export`: what was identified, as a model for another tool."""

import warnings
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.terminal import say, working
from hmpim.errors import ArgumentError, FormatError

if TYPE_CHECKING:
    from hmpim.identify import Identification

__all__ = ["export", "read_result"]


class To(StrEnum):
    """Targets."""

    CONTROL = "control"
    SCIPY = "scipy"
    MATLAB = "matlab"
    MAT = "mat"
    JSON = "json"
    C = "c"
    PYTHON = "python"
    MUJOCO = "mujoco"
    ISAAC = "isaac"
    FMU = "fmu"
    MODELICA = "modelica"
    UFF58 = "uff58"
    CSV = "csv"


class Between(StrEnum):
    """What the input of a program does between its samples."""

    ZOH = "zoh"
    FOH = "foh"
    BANDLIMITED = "bandlimited"
    FEEDFORWARD = "feedforward"


def export(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="JSON of `hmpim identify --json`.")
    ],
    to: Annotated[
        To,
        typer.Option(
            "--to",
            metavar="TARGET",
            help=f"One of {', '.join(To)}.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="PATH",
            help="File to write; a folder for c. The model takes its name.",
        ),
    ],
    output: Annotated[
        str | None, typer.Option("--output", metavar="NAME", help="Output of the pair.")
    ] = None,
    input_: Annotated[
        str | None, typer.Option("--input", metavar="NAME", help="Input of the pair.")
    ] = None,
    fs: Annotated[
        float | None,
        typer.Option(
            "--fs", metavar="HZ", help="Rate of stepped programs; by default the record's."
        ),
    ] = None,
    intersample: Annotated[
        Between | None,
        typer.Option(
            "--intersample", help="What their input does between samples; by default as identified."
        ),
    ] = None,
    timestep: Annotated[
        float | None,
        typer.Option(
            "--timestep", metavar="S", help="Step of the simulation, for mujoco and isaac."
        ),
    ] = None,
    fmi: Annotated[
        int | None,
        typer.Option("--fmi", metavar="2|3", help="Version of FMI, for fmu; 2 by default."),
    ] = None,
    pade: Annotated[
        int | None,
        typer.Option(
            "--pade", metavar="N", help="Order of the Padé approximation of the delay, for control."
        ),
    ] = None,
) -> None:
    """Export an identified model to another tool, with its error bars and origin.

    What the target represents exactly, and what it approximates and how closely, is stated in the
    file that is written.
    """
    from hmpim.formats.models import export as write

    into = {"--out": out}
    if to is To.C:
        check_files(reads={"the result": result}, folders=into)
    else:
        check_files(reads={"the result": result}, writes=into)
    found = read_result(result)
    with working(f"Writing {to.value}"), warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        written = write(
            found,
            to=to.value,
            path=str(out),
            pair=_pair(found, output, input_),
            fs=fs,
            intersample=None if intersample is None else intersample.value,
            pade=pade,
            fmi=fmi,
            timestep=timestep,
        )
    for remark in remarks:
        say(str(remark.message))
    for file in written:
        say(str(file))


def read_result(path: Path) -> "Identification":
    """Read an identification; refuse what is none.

    Raises
    ------
    FormatError
        If the file holds something else.
    """
    from hmpim.formats import load
    from hmpim.identify import Identification

    found = load(path)
    if not isinstance(found, Identification):
        raise FormatError(
            f"{str(path)!r} holds a {type(found).__name__.lower()}, not a result; give what "
            "hmpim identify --json wrote"
        )
    return found


def _pair(
    found: "Identification", output: str | None, input_: str | None
) -> tuple[str, str] | None:
    """Complete a choice of which only one half is given."""
    if output is None and input_ is None:
        return None
    fitting = [
        (p.output, p.input)
        for p in found.pairs
        if output in (None, p.output) and input_ in (None, p.input)
    ]
    if len(fitting) == 1:
        return fitting[0]
    known = ", ".join(f"{p.output} from {p.input}" for p in found.pairs)
    wanted = " ".join(
        f"--{name} {value}" for name, value in (("output", output), ("input", input_)) if value
    )
    raise ArgumentError(
        f"{wanted} fits {len(fitting)} pairs of the result, which has {known}; give --output and "
        "--input of one of them"
    )
