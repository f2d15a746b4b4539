"""Builders of software under test: code in a file, a program, an FMU."""

import dataclasses
from typing import Any

from hmpim.errors import FormatError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.catalogue.simulated import made_of, take_options
from hmpim.rigs.function import FunctionRig
from hmpim.rigs.software import FmuRig, ProcessRig, load_code
from hmpim.rigs.software.code import Fresh

__all__ = ["build_fmu", "build_process", "build_python"]

_MODES = ("array", "sample")


def build_python(argument: str, description: Description) -> FunctionRig:
    r"""Make a rig of ``python:FILE:FUNCTION``, or ``python:FILE:FUNCTION:sample``.

    A function takes the whole array unless 'sample' is said, behind a colon or as the option
    `mode`; a class is made anew for each run, and its object called sample by sample.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hmpim.rigs.catalogue.description import describe
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "mine.py")
    ...     _ = path.write_text("def double(u):\n    return 2 * u\n")
    ...     build_python(f"{path}:double:sample", describe({})).mode
    'sample'
    """
    parts = argument.split(":")
    mode = parts.pop() if len(parts) > 2 and parts[-1] in _MODES else None
    name = parts.pop() if len(parts) > 1 else ""
    file = ":".join(parts)
    if not file or not name:
        raise FormatError(f"python:{argument} names no function; write python:FILE:FUNCTION")
    spoken = file.rpartition(":")[0]
    if spoken.endswith(".py"):
        raise FormatError(
            f"python:{argument} ends in {name!r}, which is not known; after the function write "
            f"{' or '.join(_MODES)}"
        )
    known = _options(FunctionRig) - {"function", "reset"}
    options = take_options(description, known, kind="Python function", instead=_ELSEWHERE)
    function = load_code(file, name)
    if isinstance(function, Fresh):
        options |= {"reset": function.reset}
        options.setdefault("mode", "sample")
    if mode is not None:
        options["mode"] = mode
    options.setdefault("name", name)
    return made_of(FunctionRig, {"function": function} | options, kind_name="Python function")


def build_process(argument: str, description: Description) -> ProcessRig:
    """Make a rig of ``process:COMMAND``.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_process("./tracker --fast", describe({"options": {"answer": 1.0}})).answer
    1.0
    """
    known = _options(ProcessRig) - {"command"}
    options = take_options(description, known, kind="program", instead=_ELSEWHERE)
    return made_of(ProcessRig, {"command": argument} | options, kind_name="program")


def build_fmu(argument: str, description: Description) -> FmuRig:
    """Make a rig of ``fmu:FILE``.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_fmu("axis.fmu", describe({"options": {"interface": "exchange"}})).path
    'axis.fmu'
    """
    if not argument:
        raise FormatError("fmu: names no file; write fmu:FILE")
    known = _options(FmuRig) - {"path"}
    options = take_options(description, known, kind="FMU", instead=_ELSEWHERE)
    return made_of(FmuRig, {"path": argument} | options, kind_name="FMU")


_ELSEWHERE = {"limits": "limits"}


def _options(kind: type[Any]) -> set[str]:
    return {f.name for f in dataclasses.fields(kind) if f.init and f.name != "limits"}
