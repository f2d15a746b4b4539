"""Values out of a TOML table, each checked, each error naming its key."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, TypeVar

from hmpim.errors import ArgumentError

__all__ = ["Table"]

T = TypeVar("T")
_MISSING: Any = object()


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a plan; remembers which keys were asked for, so that misspelt ones are found.

    Examples
    --------
    >>> table = Table.of({"duration": 5, "durration": 6}, "stimulus.")
    >>> table.number("duration")
    5.0
    >>> table.done()
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: stimulus.durration is not known; use duration
    """

    values: Mapping[str, Any]
    where: str
    asked: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, values: object, where: str) -> "Table":
        """Check that `values` is a table."""
        if not isinstance(values, Mapping):
            raise ArgumentError(f"{where.rstrip('.')} = {values!r} must be a table")
        return cls(values, where)

    def _get(self, key: str, default: Any) -> Any:
        self.asked.add(key)
        value = self.values.get(key, default)
        if value is _MISSING:
            # The first key wanted may be there, but misspelt: then that is what to say.
            alike = get_close_matches(key, set(self.values) - self.asked, n=1)
            instead = f" in place of {alike[0]}" if alike else ""
            raise ArgumentError(f"{self.where}{key} is missing; give it{instead}")
        return value

    def _bad(self, key: str, value: object, wanted: str) -> ArgumentError:
        return ArgumentError(f"{self.where}{key} = {value!r} must be {wanted}")

    def done(self) -> None:
        """Refuse keys that nobody asked for."""
        unknown = sorted(set(self.values) - self.asked)
        if unknown:
            known = ", ".join(sorted(self.asked))
            raise ArgumentError(f"{self.where}{unknown[0]} is not known; use {known}")

    def text(self, key: str, default: str = _MISSING) -> str:
        """Return a text."""
        value = self._get(key, default)
        if not isinstance(value, str) or (default is _MISSING and not value):
            raise self._bad(key, value, "a text")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Return true or false."""
        value = self._get(key, default)
        if not isinstance(value, bool):
            raise self._bad(key, value, "true or false")
        return value

    def whole(self, key: str, default: int) -> int:
        """Return a whole number from 0 on."""
        value = self._get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self._bad(key, value, "a whole number from 0 on")
        return value

    def number(self, key: str, default: float = _MISSING, *, above: float = -math.inf) -> float:
        """Return a finite number above `above`, or the default."""
        value = self._get(key, default)
        if value is default:
            return float(value)
        return self._number(key, value, above)

    def _number(self, key: str, value: object, above: float) -> float:
        plain = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not plain or not math.isfinite(float(value)) or float(value) <= above:  # type: ignore[arg-type]
            bound = "" if above == -math.inf else f" above {max(above, 0.0):g}"
            raise self._bad(key, value, f"a finite number{bound}")
        return float(value)  # type: ignore[arg-type]

    def numbers(
        self, key: str, *, above: float, default: tuple[float, ...] = _MISSING
    ) -> tuple[float, ...]:
        """Return different numbers above `above`."""
        value = self._get(key, default)
        found = tuple(self._number(key, v, above) for v in self._listed(key, value))
        self._all_different(key, found)
        return found

    def words(
        self, key: str, known: tuple[T, ...] | None, *, default: tuple[T, ...]
    ) -> tuple[T, ...]:
        """Return different words, each one of `known` unless that is None."""
        found = tuple(self._listed(key, self._get(key, default)))
        for word in found:
            if not isinstance(word, str) or (known is not None and word not in known):
                wanted = "texts" if known is None else f"of {', '.join(map(str, known))}"
                raise ArgumentError(f"{self.where}{key} holds {word!r}; its items must be {wanted}")
        self._all_different(key, found)
        return found

    def _listed(self, key: str, value: object) -> list[Any] | tuple[Any, ...]:
        if not isinstance(value, (list, tuple)) or not value:
            raise self._bad(key, value, "a list of at least one item")
        return value

    def _all_different(self, key: str, found: tuple[object, ...]) -> None:
        if len(set(found)) < len(found):
            raise self._bad(key, list(found), "a list in which nothing stands twice")

    def choice(self, key: str, known: tuple[T, ...], *, default: Any = _MISSING) -> Any:
        """Return one of `known`, or the default."""
        value = self._get(key, default)
        if value is not default and (not isinstance(value, str) or value not in known):
            raise self._bad(key, value, f"one of {', '.join(map(str, known))}")
        return value

    def table(self, key: str, *, optional: bool = False) -> "Table":
        """Return a table in this one."""
        return Table.of(self._get(key, {} if optional else _MISSING), f"{self.where}{key}.")

    def tables(self, key: str) -> list[tuple[str, "Table"]]:
        """Return the tables in a table of this one, by name."""
        inner = self.table(key)
        return [(name, Table.of(v, f"{inner.where}{name}.")) for name, v in inner.values.items()]

    def list_of_tables(self, key: str) -> list["Table"]:
        """Return the tables of a list, ``[[key]]`` in the file."""
        value = self._get(key, [])
        if not isinstance(value, list):
            raise self._bad(key, value, f"a list of tables, [[{self.where}{key}]]")
        return [Table.of(v, f"{self.where}{key}[{i + 1}].") for i, v in enumerate(value)]

    def made(self, key: str, make: type[T]) -> T:
        """Make an object of a table whose keys are the fields of a dataclass."""
        inner = self.table(key)
        known = tuple(make.__dataclass_fields__)  # type: ignore[attr-defined]
        for name in inner.values:
            if name not in known:
                raise ArgumentError(f"{inner.where}{name} is not known; use {', '.join(known)}")
        try:
            return make(**inner.values)
        except (TypeError, ValueError) as error:
            raise ArgumentError(f"{inner.where.rstrip('.')}: {error}") from error
