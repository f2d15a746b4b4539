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
        raise FormatError(f"{str(path)!r} is no plan: {reason}") from None
    for name in told:
        if name not in ("name", "seed", "draws", "regions", *KNOWN):
            raise ArgumentError(
                f"{path.name}: {name!r} is not known; a plan has name, seed, draws, regions, "
                "[stimulus], [system], [noise]"
            )
    quantities = {table: _checked(path.name, table, told.get(table, {})) for table in KNOWN}
    seed, draws = told.get("seed", 0), told.get("draws", 100)
    if not isinstance(seed, int) or seed < 0:
        raise ArgumentError(f"{path.name}: seed = {seed!r}; give a whole number, 0 or more")
    if not isinstance(draws, int) or not 1 <= draws <= 10**8:
        raise ArgumentError(f"{path.name}: draws = {draws!r}; give a whole number from 1 on")
    plan = Plan(
        name=str(told.get("name", path.stem)),
        seed=seed,
        draws=draws,
        quantities=quantities,
        regions=tuple(told.get("regions", ())),
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
        raise ArgumentError(f"{file}: {table} is no table; write it as [{table}]")
    for name, law in given.items():
        if name not in KNOWN[table]:
            known = ", ".join(KNOWN[table])
            raise ArgumentError(f"{file}: [{table}] has no {name!r}; it may have {known}")
        _check_law(f"{file}: [{table}] {name}", law, words=name == "structure")
    return {name: given.get(name, default) for name, default in KNOWN[table].items()}


def _check_law(what: str, law: Any, *, words: bool) -> None:
    if isinstance(law, list) and law:
        for value in law:
            _check_law(what, value, words=words)
        return
    if isinstance(law, dict):
        kind, ends = next(iter(law.items()), ("", None))
        numbers = ends if isinstance(ends, list) and all(map(_is_number, ends)) else []
        if len(law) == 1 and kind in _LAWS and len(numbers) == 2:
            low, high = numbers
            if kind == "normal" or (low < high and (kind == "uniform" or low > 0)):
                return
    if words and law in ("first_order", "second_order"):
        return
    if not words and _is_number(law):
        return
    example = '"second_order"' if words else "{uniform = [0.1, 0.3]}"
    raise ArgumentError(f"{what} = {law!r} is no value and no law; write {example}")


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
    for name in plan.regions:
        if name not in plan.varied:
            known = ", ".join(plan.varied) or "none"
            raise ArgumentError(
                f"{file}: region {name!r} is no quantity that is drawn; those are {known}"
            )
