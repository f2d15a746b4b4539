"""The whole result of one record, and its JSON."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from hmpim.equality import ByValue
from hmpim.errors import FormatError
from hmpim.identify.result.estimate import Verdict
from hmpim.identify.result.first_schema import FIRST_SCHEMA, upgraded
from hmpim.identify.result.inputs import InputSet
from hmpim.identify.result.lookup import find_pair
from hmpim.identify.result.pair import PairIdentification, pair_rows
from hmpim.identify.result.plain import Plain, by_fields, fields_in
from hmpim.record import Record
from hmpim.tables import html_table, shortened

__all__ = ["SCHEMA", "Identification", "RecordSummary"]

SCHEMA = "hmpim/identification/2"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSummary(Plain):
    """Which record was identified."""

    fs: float
    samples: int
    sha256: str
    source: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identification(ByValue):
    """The result of `hmpim.identify`: one `PairIdentification` for each input and output.

    Index it output first, as in a transfer matrix: ``result["y", "u"].delay``; the output alone
    is enough where there is one input. Iterating yields the pairs.
    `inputs` says how well several inputs are distinguished, and how much of each output they
    explain; None for a single input. `data` is the record itself, kept for pictures; the JSON and
    comparisons of results use its digest in `record` instead.
    """

    record: RecordSummary
    pairs: tuple[PairIdentification, ...]
    inputs: InputSet | None = None
    data: Record | None = field(default=None, compare=False)

    def __getitem__(self, key: tuple[str, str] | str) -> PairIdentification:
        return find_pair(self.pairs, key, holder="the result")

    def __iter__(self) -> Iterator[PairIdentification]:
        return iter(self.pairs)

    def __len__(self) -> int:
        return len(self.pairs)

    def __repr__(self) -> str:
        if len(self.pairs) == 1:
            return f"Identification({self.pairs[0]!r})"
        names = [f"{pair.output}/{pair.input}" for pair in self.pairs]
        return f"Identification({len(names)} pairs, {self.verdict}: {shortened(names)})"

    def _repr_html_(self) -> str:
        """Return a table of the figures of every pair, as a notebook shows it."""
        rows = [
            [f"{pair.input} → {pair.output}", *row]
            for pair in self.pairs
            for row in pair_rows(pair) or [["–", "–", "–", pair.verdict]]
        ]
        messages = dict.fromkeys(w.message for pair in self.pairs for w in pair.warnings)
        source = f" of {self.record.source}" if self.record.source else ""
        return html_table(
            f"Identification{source}: {self.verdict}",
            ["from → to", "parameter", "value", "95 %", "verdict"],
            rows,
            notes=list(messages),
        )

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all pairs that count."""
        order: tuple[Verdict, ...] = ("ok", "doubtful", "not_identifiable")
        verdicts = (pair.verdict for pair in self.counted)
        return max(verdicts, key=order.index, default="not_identifiable")

    @property
    def counted(self) -> tuple[PairIdentification, ...]:
        """All pairs except those of an output with an input that it is not coupled to.

        It is a finding, not a failure, that an axis does not follow the command of another axis, as
        long as it follows some input.
        """
        if self.inputs is None:
            return self.pairs
        follows = {pair.output for pair in self.pairs if pair.verdict != "not_identifiable"}
        return tuple(
            pair
            for pair in self.pairs
            if pair.output not in follows
            or pair.parameters.scale_factor is not None
            or all(finding.code != "unrelated" for finding in pair.warnings)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain JSON values, `schema` first."""
        return {"schema": SCHEMA, **fields_in(self)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Identification":
        """Read back what `to_dict` wrote.

        Raises
        ------
        FormatError
            If the schema of `data` is not known.
        """
        schema = data.get("schema")
        if schema not in (SCHEMA, FIRST_SCHEMA):
            raise FormatError(f"schema is {schema!r}; {SCHEMA!r} or {FIRST_SCHEMA!r} is needed")
        pairs = data["pairs"] if schema == SCHEMA else [upgraded(p) for p in data["pairs"]]
        return by_fields(cls, {**data, "pairs": pairs})
