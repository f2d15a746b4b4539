"""The plan of a Monte Carlo study: what is drawn, and from where."""

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.errors import ArgumentError, FormatError

__all__ = ["KNOWN", "PLANS", "Plan", "Value", "drawn", "read_plan", "shipped_plan"]

PLANS = ("field", "random_systems")
"""Plans that ship."""

KNOWN: Mapping[str, Mapping[str, Any]] = {
    "stimulus": {
        "fs": 200.0,
        "duration": 10.0,
        "low": 0.1,
        "high": None,
        "high_of_fs": None,
        "high_most": math.inf,
        "extinction": 0.0,
        "amplitude": 1.0,
    },
    "system": {
        "structure": "second_order",
        "delay": 0.0,
        "natural_frequency": None,
        "frequency_of_band": None,
        "damping_ratio": 0.7,
        "scale_factor": 1.0,
        "sign": 1.0,
        "bias": 0.0,
    },
    "noise": {"std": None, "std_of_amplitude": None, "correlation": 0.0},
}
"""Quantities of each table of a plan, and what they are if it does not say."""

_LAWS = ("uniform", "loguniform", "normal")

_ABOVE_ZERO = (
    *("fs", "duration", "low", "high", "high_of_fs", "high_most"),
    *("natural_frequency", "frequency_of_band", "damping_ratio"),
)
_FROM_ZERO = ("extinction", "delay", "std", "std_of_amplitude")
_LARGEST = 1e70
"""Size beyond which, as below its inverse, products overflow in the identification."""
_NOT_ZERO = ("amplitude", "scale_factor", "sign")

Value = float | str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A Monte Carlo study.

    Parameters
    ----------
    name : str
        For people.
    seed : int
        All randomness comes from it and from the number of the draw.
    draws : int
        How many systems.
    quantities : mapping of str to mapping of str to value or law
        Tables `stimulus`, `system` and `noise`: a value, a list of values to choose from, or a
        law such as ``{uniform = [0, 1]}``.
    regions : tuple of str
        Quantities by whose quarters the figures are split.
    """

    name: str
    seed: int = 0
    draws: int = 100
    quantities: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    regions: tuple[str, ...] = ()

    @property
    def digest(self) -> str:
        """Hexadecimal digest of what the draws depend on; not of how many there are."""
        told = json.dumps([self.seed, {k: dict(v) for k, v in self.quantities.items()}])
        return hashlib.sha256(told.encode()).hexdigest()

    @property
    def varied(self) -> tuple[str, ...]:
        """Quantities that are drawn, not fixed, as ``system.delay``."""
        return tuple(
            f"{table}.{name}"
            for table, quantities in self.quantities.items()
            for name, law in quantities.items()
            if isinstance(law, (list, dict))
        )


def shipped_plan(name: str) -> Path:
    """Where a plan that ships stands."""
    return Path(__file__).parent / "plans" / f"{name}.toml"


def read_plan(path: Path) -> Plan:
    """Read a plan.

    Raises
    ------
    FormatError
        If there is no such file, or it is no TOML.
    ArgumentError
        If it says something that is not known.

    Examples
    --------
    >>> read_plan(shipped_plan("field")).draws
    500
    """
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FormatError(f"{str(path)!r} is not a plan: {reason}") from None
    for name in told:
        if name not in ("name", "seed", "draws", "regions", *KNOWN):
            raise ArgumentError(
                f"{path.name}: {name!r} is not known; a plan has name, seed, draws, regions, "
                "[stimulus], [system], [noise]"
            )
    quantities = {table: _checked(path.name, table, told.get(table, {})) for table in KNOWN}
    seed, draws = told.get("seed", 0), told.get("draws", 100)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ArgumentError(f"{path.name}: seed = {seed!r}; give a whole number, 0 or more")
    if isinstance(draws, bool) or not isinstance(draws, int) or not 1 <= draws <= 10**8:
        raise ArgumentError(f"{path.name}: draws = {draws!r}; give a whole number from 1 on")
    name = told.get("name", path.stem)
    if not isinstance(name, str):
        raise ArgumentError(f"{path.name}: name = {name!r}; give a text")
    regions = told.get("regions", [])
    if not isinstance(regions, list):
        raise ArgumentError(f"{path.name}: regions = {regions!r}; give a list of names")
    plan = Plan(
        name=name,
        seed=seed,
        draws=draws,
        quantities=quantities,
        regions=tuple(regions),
    )
    _check_whole(path.name, plan)
    return plan


def drawn(law: Any, rng: np.random.Generator) -> Value:
    """Draw one value of a law; a fixed value draws nothing.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> drawn(3.0, rng), drawn(["a"], rng), 1 <= drawn({"loguniform": [1, 2]}, rng) <= 2
    (3.0, 'a', True)
    """
    if isinstance(law, list):
        chosen = law[int(rng.integers(len(law)))]
        return chosen if isinstance(chosen, str) else float(chosen)
    if isinstance(law, dict):
        ((kind, (low, high)),) = law.items()
        if kind == "uniform":
            return float(rng.uniform(low, high))
        if kind == "loguniform":
            return float(np.exp(rng.uniform(np.log(low), np.log(high))))
        return float(rng.normal(low, high))
    return law if law is None or isinstance(law, str) else float(law)


def _checked(file: str, table: str, given: Any) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise ArgumentError(f"{file}: {table} is not a table; write it as [{table}]")
    for name, law in given.items():
        if name not in KNOWN[table]:
            known = ", ".join(KNOWN[table])
            raise ArgumentError(f"{file}: [{table}] has no {name!r}; it may have {known}")
        what = f"{file}: [{table}] {name}"
        _check_law(what, law, words=name == "structure")
        _check_range(what, name, law)
    return {name: given.get(name, default) for name, default in KNOWN[table].items()}


def _check_law(what: str, law: Any, *, words: bool) -> None:
    values = law if isinstance(law, list) and law else [law]
    bad = next((value for value in values if not _is_value(value, words=words)), None)
    if bad is None:
        return
    if isinstance(law, dict):
        kind, ends = next(iter(law.items()), ("", None))
        numbers = ends if isinstance(ends, list) and all(map(_is_number, ends)) else []
        if len(law) == 1 and kind in _LAWS and len(numbers) == 2:
            low, high = numbers
            if kind == "normal" or (low < high and (kind == "uniform" or low > 0)):
                return
    example = '"second_order"' if words else "{uniform = [0.1, 0.3]}"
    raise ArgumentError(f"{what} = {bad!r} is neither a value nor a law; write {example}")


def _is_value(value: object, *, words: bool) -> bool:
    return value in ("first_order", "second_order") if words else _is_number(value)


def _check_range(what: str, name: str, law: Any) -> None:
    """Refuse what no draw could be made of."""
    for value in _ends(law):
        if value != 0 and not 1.0 / _LARGEST < abs(value) < _LARGEST:
            raise ArgumentError(f"{what} = {value:g} is out of range; nothing could be computed")
        if name in _ABOVE_ZERO and not value > 0:
            raise ArgumentError(f"{what} = {value:g} is out of range; it must be more than 0")
        if name in _FROM_ZERO and not value >= 0:
            raise ArgumentError(f"{what} = {value:g} is out of range; it must be at least 0")
        if name in _NOT_ZERO and value == 0:
            raise ArgumentError(f"{what} = 0 moves nothing; give another number")
        if name == "correlation" and not abs(value) < 1:
            raise ArgumentError(f"{what} = {value:g} is out of range; it must lie between -1 and 1")


def _ends(law: Any) -> list[float]:
    """The values of a law between which all others lie; a normal law has none."""
    if isinstance(law, dict):
        return [] if "normal" in law else list(next(iter(law.values())))
    return [value for value in (law if isinstance(law, list) else [law]) if _is_number(value)]


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _check_whole(file: str, plan: Plan) -> None:
    either = (
        ("stimulus", "high", "high_of_fs"),
        ("system", "natural_frequency", "frequency_of_band"),
        ("noise", "std", "std_of_amplitude"),
    )
    for table, one, other in either:
        if (plan.quantities[table][one] is None) == (plan.quantities[table][other] is None):
            raise ArgumentError(f"{file}: [{table}] must say one of {one} and {other}")
    _check_sampling(file, plan)
    for name in plan.regions:
        if name not in plan.varied:
            known = ", ".join(plan.varied) or "none"
            raise ArgumentError(
                f"{file}: region {name!r} is not a quantity that is drawn; those are {known}"
            )


def _check_sampling(file: str, plan: Plan) -> None:
    """Refuse a band that sampling folds, and a delay that no record of the plan shows."""
    stimulus = plan.quantities["stimulus"]
    fs, duration = _ends(stimulus["fs"]), _ends(stimulus["duration"])
    for name, nyquist in (("high", min(fs, default=math.inf) / 2), ("high_of_fs", 0.5)):
        top = max(_ends(stimulus[name]), default=0.0)
        if top >= nyquist:
            raise ArgumentError(
                f"{file}: [stimulus] {name} = {top:g} reaches the Nyquist frequency; "
                f"stay below {nyquist:g}"
            )
    delay = max(_ends(plan.quantities["system"]["delay"]), default=0.0)
    if delay >= min(duration, default=math.inf):
        raise ArgumentError(
            f"{file}: [system] delay = {delay:g} s is as long as a record of "
            f"{min(duration):g} s, in which no response would be seen; give a shorter delay"
        )
