"""A study as one TOML file: which axes, modes, rates, levels and loads, and what is wanted."""

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, get_args

from hmpim.campaign.checked import Table
from hmpim.errors import ArgumentError, FormatError, HmpimError
from hmpim.identify import Parameters
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits

__all__ = [
    "QUANTITIES",
    "AxisWish",
    "Compare",
    "FigurePlan",
    "Plan",
    "RigPlan",
    "Specification",
    "TestPlan",
    "parse_plan",
    "read_plan",
]

RigKind = Literal["table", "sensor", "python"]
Mode = Literal["P", "PV", "PVA"]
Compare = Literal["rates", "loads", "levels", "modes", "excitation", "stimulus", "fence", "axes"]
QUANTITIES = tuple(field.name for field in fields(Parameters))
_SCALED = ("velocity", "acceleration")
_NOT_MEASURED = ("name", "description", "compare", "specification", "figure")


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisWish:
    """One axis: the band to excite (Hz), and within which limits.

    `limits` are the axis's own; None takes the rig's. `travel` is the largest position wanted,
    in the limits' unit. `sensor` is the simulated unit of a rig of kind 'sensor'.
    """

    name: str
    band: tuple[float, float]
    travel: float | None = None
    limits: Limits | None = None
    sensor: Sensor | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RigPlan:
    """The unit under test: the motion table, a simulated sensor per axis, or a function."""

    kind: RigKind
    friction: bool = True
    encoder_noise_std: float = 0.0005
    entry: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestPlan:
    """A product of axes, modes, rates (Hz), levels and loads.

    Levels are shares of the limits on the quantities of `levels_of`. `travel` and `bands` take
    the place of those of the axes.
    """

    __test__ = False  # no test of pytest's

    name: str
    axes: tuple[str, ...]
    modes: tuple[Mode, ...] = ("P",)
    rates: tuple[float, ...] = (1000.0,)
    levels: tuple[float, ...] = (0.5,)
    loads: tuple[str, ...] = ("acceptance",)
    together: bool = False
    levels_of: tuple[str, ...] = _SCALED
    travel: float | None = None
    bands: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """What a quantity must be, for the cases that the other fields name (None: all)."""

    quantity: str
    low: float
    high: float
    test: str | None = None
    axis: str | None = None
    mode: str | None = None
    load: str | None = None
    rate: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FigurePlan:
    """A section of the study: some tests of some axes, overlaid and compared."""

    title: str
    tests: tuple[str, ...]
    compare: Compare
    axes: tuple[str, ...] = ()
    observed: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A study to be made; `digest` stands for everything that decides what is measured.

    `folder` is where the plan's file lies; a rig of one's own is looked for there too.
    """

    name: str
    rig: RigPlan
    axes: tuple[AxisWish, ...]
    tests: tuple[TestPlan, ...]
    description: str = ""
    seed: int = 0
    duration: float = 10.0
    specifications: tuple[Specification, ...] = ()
    figures: tuple[FigurePlan, ...] = ()
    compare: str = ""
    digest: str = ""
    folder: str = ""

    def axis(self, name: str, *, test: str | None = None) -> AxisWish:
        """Return what is wished of an axis, in a test that may wish something else of it.

        Raises
        ------
        ArgumentError
            If the plan has no such axis.
        """
        for wish in self.axes:
            if wish.name != name:
                continue
            for own in self.tests:
                if own.name == test:
                    travel = wish.travel if own.travel is None else own.travel
                    return replace(wish, travel=travel, band=own.bands.get(name, wish.band))
            return wish
        known = ", ".join(wish.name for wish in self.axes)
        raise ArgumentError(f"axis {name!r} is not in the plan, which has {known}")


def read_plan(path: Path) -> Plan:
    """Read a plan from a TOML file.

    Raises
    ------
    FormatError
        If the file is no TOML.
    ArgumentError
        If a key is missing, not known or out of range; the message names it.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> from hmpim.campaign.shipped import shipped_plan
    >>> read_plan(shipped_plan("example")).name
    'Two gimbals'
    """
    data = path.read_bytes()
    try:
        table = tomllib.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FormatError(f"{path} is not a TOML plan: {error}") from error
    try:
        return replace(parse_plan(table), folder=str(path.resolve().parent))
    except HmpimError as error:
        raise type(error)(f"{path.name}: {error}") from error


def parse_plan(data: Mapping[str, Any]) -> Plan:
    """Make a plan of what `tomllib` read; the plan that ships as ``example`` has every key.

    Parameters
    ----------
    data : mapping
        Keys as in the file.

    Raises
    ------
    ArgumentError
        If a key is missing, not known or out of range; the message names it.

    Examples
    --------
    >>> parse_plan({"name": "n", "rig": {"kind": "table"}, "axes": {}})
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: axes is empty; give at least one, such as [axes.roll]
    """
    top = Table.of(data, "")
    rig = _rig(top.table("rig"))
    stimulus = top.table("stimulus", optional=True)
    axes = tuple(_axis(name, table, rig.kind) for name, table in top.tables("axes"))
    if not axes:
        raise ArgumentError("axes is empty; give at least one, such as [axes.roll]")
    names = tuple(axis.name for axis in axes)
    tests = tuple(_test(table, names, rig.kind) for table in top.list_of_tables("test"))
    if not tests:
        raise ArgumentError("test is missing; give at least one [[test]]")
    known = tuple(test.name for test in tests)
    if len(set(known)) < len(known):
        raise ArgumentError(f"test names are {known}; give each one a name of its own")
    plan = Plan(
        name=top.text("name"),
        description=top.text("description", ""),
        seed=top.whole("seed", 0),
        compare=top.text("compare", ""),
        rig=rig,
        duration=stimulus.number("duration", 10.0, above=0.0),
        axes=axes,
        tests=tests,
        specifications=tuple(
            _specification(table, names, known) for table in top.list_of_tables("specification")
        ),
        figures=tuple(_figure(table, names, known) for table in top.list_of_tables("figure"))
        or tuple(
            FigurePlan(title=t.name, tests=(t.name,), compare="axes", axes=t.axes) for t in tests
        ),
        digest=_digest(data),
    )
    stimulus.done()
    top.done()
    return plan


def _digest(data: Mapping[str, Any]) -> str:
    """Digest of the keys that decide what is measured; limits and words may change freely."""
    measured = {key: value for key, value in data.items() if key not in _NOT_MEASURED}
    text = json.dumps(measured, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _rig(table: Table) -> RigPlan:
    kind = table.choice("kind", get_args(RigKind))
    rig = RigPlan(
        kind=kind,
        friction=table.flag("friction", True) if kind == "table" else True,
        encoder_noise_std=table.number("encoder_noise_std", 0.0005, above=-1e-300)
        if kind == "table"
        else 0.0,
        entry=table.text("entry") if kind == "python" else "",
    )
    if kind == "python" and ":" not in rig.entry:
        raise ArgumentError(f"rig.entry = {rig.entry!r} must be 'module:function'")
    table.done()
    return rig


def _band(table: Table, key: str) -> tuple[float, float]:
    band = table.numbers(key, above=0.0)
    if len(band) != 2 or band[0] >= band[1]:
        raise ArgumentError(f"{table.where}{key} = {list(band)} must be two rising frequencies, Hz")
    return band[0], band[1]


def _travel(table: Table) -> float | None:
    travel = table.number("travel", math.inf, above=0.0)
    return None if math.isinf(travel) else travel


def _axis(name: str, table: Table, kind: RigKind) -> AxisWish:
    from hmpim.rigs.table import AXES

    if kind == "table" and name not in AXES:
        raise ArgumentError(f"axes.{name} is not an axis of the table; use {', '.join(AXES)}")
    band = _band(table, "band")
    limits = sensor = None
    if kind != "table":
        limits = table.made("limits", Limits)
    if kind == "sensor":
        sensor = table.made("sensor", Sensor)
    wish = AxisWish(
        name=name,
        band=band,
        travel=_travel(table),
        limits=limits,
        sensor=sensor,
    )
    table.done()
    return wish


def _test(table: Table, axes: tuple[str, ...], kind: RigKind) -> TestPlan:
    bands = table.table("bands", optional=True)
    test = TestPlan(
        name=table.text("name"),
        axes=table.words("axes", axes, default=axes),
        modes=table.words("modes", get_args(Mode), default=("P",)),
        rates=table.numbers("rates", above=0.0, default=(1000.0,)),
        levels=table.numbers("levels", above=0.0, default=(0.5,)),
        loads=table.words("loads", None, default=("acceptance",)),
        together=table.flag("together", False),
        levels_of=table.words("levels_of", _SCALED, default=_SCALED),
        travel=_travel(table),
        bands={axis: _band(bands, axis) for axis in axes if axis in bands.values},
    )
    bands.asked.update(axes)
    bands.done()
    where = table.where
    if max(test.levels) > 1.0:
        raise ArgumentError(f"{where}levels = {list(test.levels)} go beyond 1, the limit itself")
    if not all(c.isalnum() or c in "-_" for c in test.name):
        raise ArgumentError(f"{where}name = {test.name!r} may hold letters, digits, - and _ only")
    if kind == "sensor" and (test.modes != ("P",) or test.loads != ("acceptance",)):
        raise ArgumentError(f"{where}modes and loads belong to a table; leave them out here")
    if kind == "sensor" and test.together:
        raise ArgumentError(f"{where}together needs a rig with several axes; leave it out")
    table.done()
    return test


def _specification(table: Table, axes: tuple[str, ...], tests: tuple[str, ...]) -> Specification:
    wanted = Specification(
        quantity=table.choice("quantity", QUANTITIES),
        low=table.number("min", -math.inf),
        high=table.number("max", math.inf),
        test=table.choice("test", tests, default=None),
        axis=table.choice("axis", axes, default=None),
        mode=table.choice("mode", get_args(Mode), default=None),
        load=table.text("load", "") or None,
        rate=table.number("rate", 0.0) or None,
    )
    table.done()
    if wanted.low > wanted.high or (wanted.low, wanted.high) == (-math.inf, math.inf):
        raise ArgumentError(
            f"{table.where}min = {wanted.low:g} and max = {wanted.high:g} limit nothing; "
            "give min, max or both, min first"
        )
    return wanted


def _figure(table: Table, axes: tuple[str, ...], tests: tuple[str, ...]) -> FigurePlan:
    figure = FigurePlan(
        title=table.text("title"),
        tests=table.words("tests", tests, default=tests),
        compare=table.choice("compare", get_args(Compare)),
        axes=table.words("axes", axes, default=axes),
        observed=table.text("observed", ""),
    )
    table.done()
    return figure
