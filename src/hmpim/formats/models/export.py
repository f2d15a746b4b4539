"""One door for all targets: which file each becomes, and who writes it."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal, get_args

from hmpim.arguments import checked
from hmpim.errors import ArgumentError
from hmpim.formats.models.c import write_c
from hmpim.formats.models.csv import write_csv
from hmpim.formats.models.fmu import write_fmu
from hmpim.formats.models.isaac import write_isaac
from hmpim.formats.models.json import write_json
from hmpim.formats.models.linear import write_control, write_scipy
from hmpim.formats.models.mat import write_mat
from hmpim.formats.models.matlab import write_matlab
from hmpim.formats.models.modelica import write_modelica
from hmpim.formats.models.mujoco import write_mujoco
from hmpim.formats.models.nonlinear import LinearPartOnly, with_nonlinear_part
from hmpim.formats.models.python import write_python
from hmpim.formats.models.source import Source, identifier, source_of
from hmpim.formats.models.uff58 import write_uff58
from hmpim.identify import Identification, has_model
from hmpim.record import Intersample

__all__ = ["TARGETS", "Target", "export"]

Target = Literal[
    "control",
    "scipy",
    "matlab",
    "mat",
    "json",
    "c",
    "python",
    "mujoco",
    "isaac",
    "fmu",
    "modelica",
    "uff58",
    "csv",
]
"""What a result can be exported to."""

_CONTINUOUS = ("control", "scipy", "matlab", "mat", "mujoco", "isaac", "modelica")
"""Those that are written as transfer functions of s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Choices:
    """What some targets alone can be told; None where it is left to them."""

    pade: int | None = None
    fmi: int | None = None
    timestep: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Writer:
    """How a target is written.

    Parameters
    ----------
    suffix : str
        Of its file; "" for a folder of files.
    write : callable
        Writes it.
    choices : tuple of str
        Which of the choices it takes.
    """

    suffix: str
    write: Callable[[Source, Path, _Choices], tuple[Path, ...]]
    choices: tuple[str, ...] = ()


TARGETS: dict[str, _Writer] = {
    "control": _Writer(
        suffix=".py", write=lambda s, p, c: write_control(s, p, pade=c.pade), choices=("pade",)
    ),
    "scipy": _Writer(suffix=".py", write=lambda s, p, c: write_scipy(s, p)),
    "matlab": _Writer(suffix=".m", write=lambda s, p, c: write_matlab(s, p)),
    "mat": _Writer(suffix=".mat", write=lambda s, p, c: write_mat(s, p)),
    "json": _Writer(suffix=".json", write=lambda s, p, c: write_json(s, p)),
    "c": _Writer(suffix="", write=lambda s, p, c: write_c(s, p)),
    "python": _Writer(suffix=".py", write=lambda s, p, c: write_python(s, p)),
    "fmu": _Writer(
        suffix=".fmu", write=lambda s, p, c: write_fmu(s, p, fmi=c.fmi or 2), choices=("fmi",)
    ),
    "mujoco": _Writer(
        suffix=".xml",
        write=lambda s, p, c: write_mujoco(s, p, timestep=c.timestep),
        choices=("timestep",),
    ),
    "isaac": _Writer(
        suffix=".py",
        write=lambda s, p, c: write_isaac(s, p, timestep=c.timestep),
        choices=("timestep",),
    ),
    "modelica": _Writer(suffix=".mo", write=lambda s, p, c: write_modelica(s, p)),
    "uff58": _Writer(suffix=".uff", write=lambda s, p, c: write_uff58(s, p)),
    "csv": _Writer(suffix=".csv", write=lambda s, p, c: write_csv(s, p)),
}


_RESERVED = {
    "matlab": (
        "break case catch classdef continue else elseif end for function global if otherwise "
        "parfor persistent return spmd switch try while"
    ),
    "modelica": (
        "algorithm and annotation block break class connect connector constant constrainedby der "
        "discrete each else elseif elsewhen encapsulated end enumeration equation expandable "
        "extends external false final flow for function if import impure in initial inner input "
        "loop model not operator or outer output package parameter partial protected public pure "
        "record redeclare replaceable return stream then true type when while within"
    ),
}
"""Words of the languages in which a model has the name of its file, and could not have these."""


@checked
def export(
    result: Identification,
    *,
    to: Target | str,
    path: str | PathLike[str],
    pair: tuple[str, str] | None = None,
    fs: float | None = None,
    intersample: Intersample | None = None,
    pade: int | None = None,
    fmi: int | None = None,
    timestep: float | None = None,
) -> tuple[Path, ...]:
    """Export an identified model to another tool.

    Every export contains the error bars, the units and its origin: the digest of the record, the
    version of hmpim, the verdict and the warnings. Each file states what is exact in it and what
    is not, and by how much. A nonlinear part is included if the target has a form for it;
    otherwise the file states what it lacks.

    Parameters
    ----------
    result : Identification
        From `hmpim.identify`, or read back.
    to : str
        The target: 'control', 'scipy', 'matlab', 'mat', 'json', 'c', 'python', 'mujoco', 'isaac',
        'fmu', 'modelica', 'uff58' or 'csv'.
    path : str or path-like
        File to write; for C a folder, made if it is missing. A folder for a target of one file
        gets it under the name of the pair. The name, without its suffix, is the model's.
    pair : tuple of str, optional
        Output and input; the only pair that has a model by default.
    fs : float, optional
        Rate in Hz of programs that are stepped; that of the record by default.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}, optional
        What their input does between its samples; as identified by default.
    pade : int, optional
        Order of python-control's Padé approximation, 1 to 20; by default the least that is right
        to 1 % over the excited band.
    fmi : {2, 3}, optional
        Version of FMI; 2 by default.
    timestep : float, optional
        Step in s of the simulator that the model is for, where the target needs it.

    Returns
    -------
    tuple of pathlib.Path
        The files written.

    Raises
    ------
    ArgumentError
        If the target is not known, a pair must be chosen, or the target cannot hold the model.
    RecordError
        If the record does not determine a figure that the model needs.

    Warns
    -----
    LinearPartOnly
        If a nonlinearity was found that the target has no form for, or that is not part of the
        model. The file says so too.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import hmpim
    >>> u = np.sin(2 * np.pi * (0.1 * np.arange(1000) / 100 + (np.arange(1000) / 100) ** 2))
    >>> y = np.interp(np.arange(1000) - 5.0, np.arange(1000), u, left=0)
    >>> noise = 0.01 * np.random.default_rng(1).standard_normal(1000)
    >>> record = hmpim.Record.from_arrays({"u": u}, {"y": y + noise}, fs=100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = export(hmpim.identify(record), to="c", path=Path(folder, "lag"))
    ...     [file.name for file in written]
    ['lag.h', 'lag.c']
    """
    writer = TARGETS.get(to)
    if writer is None:
        raise ArgumentError(
            f"target {to!r} is not known; choose one of {', '.join(get_args(Target))}"
        )
    choices = _Choices(pade=pade, fmi=fmi, timestep=timestep)
    for name in ("pade", "fmi", "timestep"):
        if getattr(choices, name) is not None and name not in writer.choices:
            able = ", ".join(key for key, one in TARGETS.items() if name in one.choices)
            raise ArgumentError(
                f"{name} = {getattr(choices, name)!r} is for {able} alone, not {to}"
            )
    if not isinstance(result, Identification):
        raise ArgumentError(
            f"{type(result).__name__} is not a result; give what hmpim.identify returned or what "
            "was read back from its JSON"
        )
    place = Path(path)
    into_folder = str(path).endswith(("/", "\\")) or place.is_dir()
    if writer.suffix and into_folder:
        name = "_from_".join(pair) if pair else _named(result)
        place.mkdir(parents=True, exist_ok=True)
        place = place / f"{identifier(name) if to in _RESERVED else name}{writer.suffix}"
    elif not writer.suffix and place.is_file():
        raise ArgumentError(f"{place} is a file; {to} needs a folder, so name another place")
    elif writer.suffix and not place.parent.is_dir():
        raise ArgumentError(f"folder {place.parent} does not exist; make it first")
    name = (place.name if not writer.suffix else place.stem) or place.resolve().name
    if to == "modelica" and name in _RESERVED[to].split():
        name += "_model"  # a Modelica tool opens the file, whatever it is called
    source = source_of(result, name=name, pair=pair, fs=fs, intersample=intersample)
    _check_kind(to, source)
    if to == "matlab":
        _check_name(place, source.name)
    source, lacking = with_nonlinear_part(source, to)
    written = writer.write(source, place, choices)
    if lacking is not None:
        warnings.warn(f"{place.name}: {lacking}", LinearPartOnly, stacklevel=2)
    return written


def _check_kind(to: str, source: Source) -> None:
    if to in _CONTINUOUS and source.pair.intersample == "sampled":
        raise ArgumentError(
            f"target {to!r} takes systems in continuous time, and this result is of software, "
            "which knows samples alone; export it to c, python, fmu, json or csv"
        )


def _check_name(place: Path, name: str) -> None:
    """Refuse a file that MATLAB, which finds a function by its file, could not call."""
    reserved = name in _RESERVED["matlab"].split()
    if place.stem != name or reserved:
        better = f"{name}_model" if reserved else name
        raise ArgumentError(
            f"{place.name!r} cannot be called: MATLAB finds it by the name of its file; name it "
            f"{better}{place.suffix}"
        )


def _named(result: Identification) -> str:
    known = [p for p in result.pairs if has_model(p)]
    chosen = (known or list(result.pairs))[0]
    return f"{chosen.output}_from_{chosen.input}"
