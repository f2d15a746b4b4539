"""Desks: what a person has typed, chosen and set by hand, kept over a reload and a restart.

Each window has a desk of its own, named in its address. A desk is a frozen value; every change
makes a new one and writes it to the folder of the runs.
"""

import json
import re
import secrets
import types
import typing
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

from hmpim.formats.atomic import write_text

__all__ = ["Analysis", "AxisRow", "Campaign", "Checked", "Desk", "Desks", "Model", "Wish"]

_NAME = re.compile(r"^[a-z0-9]{8,32}$")
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisRow:
    """One axis of a design: what it may do, and the band to excite (Hz).

    `amplitude` is the position that is used; at most `position`.
    """

    name: str = ""
    low: float = 0.1
    high: float = 20.0
    position: float = 10.0
    velocity: float = 1000.0
    acceleration: float = 40000.0
    amplitude: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """What is roughly known of the unit, and how well it is to be known (95 %, %).

    `delay` in s, `natural_frequency` in Hz, `noise_std` in the unit; `wanted` is the largest error
    allowed of the natural frequency in per cent of it.
    """

    delay: float = 0.01
    natural_frequency: float = 10.0
    damping_ratio: float = 0.5
    noise_std: float = 0.1
    wanted: float = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """A design: rows of axes, length in s, rate in Hz, and the sliders.

    `extinction` and `lead` are None where they are solved. `gentlest` asks for the gentlest
    stimulus that tells what is wanted, in place of a sweep that uses the limits.
    """

    rows: tuple[AxisRow, ...] = (AxisRow(),)
    gentlest: bool = False
    duration: float = 10.0
    fs: float = 1000.0
    unit: str = "deg"
    extinction: float | None = None
    lead: float | None = None
    alpha: float = 1.5
    model: Model = field(default_factory=Model)


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """A check that was made: of which rig and design, and how each part came out."""

    rig: str = ""
    digest: str = ""
    green: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What is analysed, and what was set by hand.

    `start`, `stop` in s and `structure` are None for all and any; `intersample` and `reference` are
    as `hmpim.identify` takes them; `hand` holds values set by hand, by parameter.
    """

    file: str = ""
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    fs: float | None = None
    start: float | None = None
    stop: float | None = None
    structure: str | None = None
    intersample: str = "auto"
    reference: str | None = None
    window: str = "gaussian"
    alpha: float = 1.5
    pair: int = 0
    hand: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """The plan as it is being edited, and the folder of its study."""

    plan: str = ""
    out: str = "campaign"


@dataclass(frozen=True, slots=True, kw_only=True)
class Desk:
    """Everything that belongs to one window."""

    name: str
    wish: Wish = field(default_factory=Wish)
    rig: str = ""
    checked: Checked = field(default_factory=Checked)
    analysis: Analysis = field(default_factory=Analysis)
    campaign: Campaign = field(default_factory=Campaign)
    chosen_runs: tuple[str, ...] = ()
    dark: bool | None = None


class Desks:
    """All desks, in memory and on disk.

    Parameters
    ----------
    folder : Path
        Where they are kept; made when the first is written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     desk = Desks(Path(folder)).fresh()
    ...     _ = Desks(Path(folder)).put(replace(desk, rig="bench"))
    ...     Desks(Path(folder)).get(desk.name).rig
    'bench'
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[str, Desk] = {}

    def get(self, name: str) -> Desk | None:
        """Return the desk of a name, if there is one."""
        if not _NAME.match(name):
            return None
        if name not in self._known:
            desk = _read(self._folder / f"{name}.json")
            if desk is None:
                return None
            self._known[name] = desk
        return self._known[name]

    def put(self, desk: Desk) -> Desk:
        """Keep a desk as it is now; return it."""
        self._known[desk.name] = desk
        self._folder.mkdir(parents=True, exist_ok=True)
        write_text(self._folder / f"{desk.name}.json", json.dumps(asdict(desk), indent=1))
        return desk

    def fresh(self) -> Desk:
        """Return a new, empty desk."""
        return self.put(Desk(name=secrets.token_hex(6)))

    def copy(self, desk: Desk) -> Desk:
        """Return a desk that begins like another one."""
        return self.put(replace(desk, name=secrets.token_hex(6)))

    def latest(self, *, without: set[str]) -> Desk:
        """Return the desk that was changed last and is not open, or a fresh one."""
        try:
            files = sorted(self._folder.glob("*.json"), key=lambda p: p.stat().st_mtime)
        except OSError:
            files = []
        for file in reversed(files):
            desk = self.get(file.stem)
            if desk is not None and desk.name not in without:
                return desk
        return self.fresh()


def _read(path: Path) -> Desk | None:
    """Read a desk back; what this version does not know is left out, what is damaged is new."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return _made(Desk, data) if isinstance(data, dict) else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _made(kind: type[T], data: Mapping[str, Any]) -> T:
    hints = typing.get_type_hints(kind)
    values = {
        f.name: _value(hints[f.name], data[f.name])
        for f in fields(kind)  # type: ignore[arg-type]
        if f.name in data
    }
    return kind(**values)


def _value(hint: Any, given: Any) -> Any:
    """A value as its field is declared: JSON knows neither tuples nor dataclasses."""
    if is_dataclass(hint) and isinstance(hint, type):
        return _made(hint, given)
    origin = typing.get_origin(hint)
    if origin is tuple:
        (inner, *_) = typing.get_args(hint)
        return tuple(_value(inner, one) for one in given)
    if origin in (types.UnionType, typing.Union):
        kept = [one for one in typing.get_args(hint) if one is not type(None)]
        return None if given is None else _value(kept[0], given)
    if hint is float:
        return float(given)
    if hint in (str, int, bool):
        if not isinstance(given, hint):
            raise TypeError(given)
        return given
    if origin is Literal:
        return given
    return {str(key): float(value) for key, value in given.items()}
