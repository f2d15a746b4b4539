"""The kinds of rigs there are: our own, and those that other packages bring by entry point.

A kind is a function that takes what stands behind the colon, and the description::

    def build(argument: str, description: Description) -> Rig: ...

Another package offers one in its ``pyproject.toml``::

    [project.entry-points."hmpim.rigs"]
    shaker = "my_package.rigs:build"
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import cast

from hmpim.errors import RigError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.protocol import Rig

__all__ = ["KINDS", "Builder", "Kind", "Offered", "load_builder", "offered_kinds"]

Builder = Callable[[str, Description], Rig]
"""Makes a rig from what stands behind the colon, and the description."""

_GROUP = "hmpim.rigs"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of rig that this package brings.

    Parameters
    ----------
    name : str
        What stands before the colon.
    form : str
        How it is written on the command line.
    words : str
        What it is, in a line.
    builder : str
        ``module:function`` of its `Builder`, imported when it is used.
    """

    name: str
    form: str
    words: str
    builder: str


KINDS: tuple[Kind, ...] = (
    Kind(
        name="sensor",
        form="sensor",
        words="simulated sensor of Fig. 1; options are those of hmpim.Sensor",
        builder="hmpim.rigs.catalogue.simulated:build_sensor",
    ),
    Kind(
        name="table",
        form="table",
        words="simulated five-axis motion table (extra 'table'), as fast as it computes",
        builder="hmpim.rigs.catalogue.simulated:build_table",
    ),
    Kind(
        name="python",
        form="python:FILE:FUNCTION",
        words="a function of a Python file, given the whole array; with :sample behind it, or a "
        "class, sample by sample",
        builder="hmpim.rigs.catalogue.software:build_python",
    ),
    Kind(
        name="process",
        form="process:COMMAND",
        words="a program of any language, over standard input and output: a line for each sample",
        builder="hmpim.rigs.catalogue.software:build_process",
    ),
    Kind(
        name="fmu",
        form="fmu:FILE",
        words="an FMU of FMI 2 or 3, co-simulation or model exchange (extra 'fmu')",
        builder="hmpim.rigs.catalogue.software:build_fmu",
    ),
    Kind(
        name="tracker",
        form="tracker",
        words="a rendered scene, a camera and a tracker (extra 'tracker'): OpenCV's or your own",
        builder="hmpim.rigs.catalogue.seen:build_tracker",
    ),
    Kind(
        name="seeker",
        form="seeker",
        words="a seeker on the five-axis table that follows what a tracker sees (extras 'table' "
        "and 'tracker')",
        builder="hmpim.rigs.catalogue.seen:build_seeker",
    ),
    Kind(
        name="udp",
        form="udp://HOST:PORT",
        words="a rig that speaks hmpim's datagrams, such as hmpim table --udp",
        builder="hmpim.rigs.catalogue.wired:build_udp",
    ),
    Kind(
        name="serial",
        form="serial:PORT",
        words="the same datagrams over a serial line (extra 'serial'); option baud",
        builder="hmpim.rigs.catalogue.wired:build_serial",
    ),
    Kind(
        name="can",
        form="can:CHANNEL",
        words="the same datagrams over a CAN bus (extra 'can'); options interface, bitrate",
        builder="hmpim.rigs.catalogue.wired:build_can",
    ),
)
"""Add a kind here; its builder's module may import what it needs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Offered:
    """A kind that another package offers.

    Parameters
    ----------
    name : str
        Of the entry point.
    value : str
        ``module:function``.
    package : str
        Who offers it.
    fault : str
        Why it is skipped; empty if it can be used.
    builder : callable or None
        Its `Builder`, None where it is skipped.
    """

    name: str
    value: str
    package: str
    fault: str = ""
    builder: Builder | None = None


def offered_kinds(points: tuple[EntryPoint, ...] | None = None) -> tuple[Offered, ...]:
    """Import what other packages offer; a broken one is named and skipped.

    Parameters
    ----------
    points : tuple of EntryPoint or None
        None for those that are installed.

    Examples
    --------
    >>> broken = EntryPoint(name="shaker", value="no_such_module:build", group="hmpim.rigs")
    >>> offered_kinds((broken,))[0].fault
    "ModuleNotFoundError: No module named 'no_such_module'"
    """
    given = entry_points(group=_GROUP) if points is None else points
    return tuple(_offered(point) for point in sorted(given, key=lambda point: point.name))


def _offered(point: EntryPoint) -> Offered:
    package = point.dist.name if point.dist is not None else ""
    fault, builder = "", None
    if any(kind.name == point.name for kind in KINDS):
        fault = f"{point.name!r} is a kind of hmpim itself; it needs another name"
    else:
        try:
            builder = point.load()
        except Exception as error:  # another's module may raise anything
            fault = " ".join(f"{type(error).__name__}: {error}".split())
        else:
            if not callable(builder):
                fault, builder = f"{point.value} is {builder!r}, and no function", None
    return Offered(
        name=point.name,
        value=point.value,
        package=package,
        fault=fault,
        builder=cast("Builder | None", builder),
    )


def load_builder(name: str) -> Builder | None:
    """Return the builder of a kind, None if there is no such kind.

    Raises
    ------
    RigError
        If another package's is broken.

    Examples
    --------
    >>> load_builder("sensor").__name__
    'build_sensor'
    >>> load_builder("warp drive") is None
    True
    """
    for kind in KINDS:
        if kind.name == name:
            module, _, function = kind.builder.partition(":")
            return cast("Builder", getattr(import_module(module), function))
    for point in entry_points(group=_GROUP, name=name):
        offered = _offered(point)
        if offered.builder is None:
            raise RigError(
                f"rig {name!r} of {offered.package or 'another package'} is broken: {offered.fault}"
            )
        return offered.builder
    return None
