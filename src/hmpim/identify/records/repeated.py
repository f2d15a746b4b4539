"""Result of several records of one stimulus."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hmpim.errors import RecordError
from hmpim.identify.result import Estimate, FrequencyResponse, Identification
from hmpim.identify.result.digits import percent
from hmpim.identify.result.lookup import find_pair
from hmpim.identify.result.plain import fields_in
from hmpim.record import Finding
from hmpim.tables import html_table, shortened

__all__ = ["RepeatedPair", "RepeatedParameter", "Repeats"]

SCHEMA = "hmpim/repeats/1"

_HEADS = ("parameter", "mean", "repeatability", "chance", "stated errors agree", "verdict")
"""Column heads of the table for notebooks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedParameter:
    """One parameter, averaged over the repeats that determine it.

    Parameters
    ----------
    name : str
        As in `Parameters`.
    mean : Estimate
        Weighted by 1/std². Its std follows from the weights, or from the scatter if that is
        larger (R. T. Birge, Phys. Rev. 40, 1932). If the interval of every repeat includes
        another model, so does that of the mean, and its std is None.
    values : tuple of float
        One for each repeat that determines it.
    repeatability : float
        Standard deviation from repeat to repeat, same unit.
    chi_squared : float
        Σ (value - mean)²/std²; its expectation is `freedom` if the stated errors are right.
    freedom : int
        Number of values less one.
    probability : float
        Probability of a larger `chi_squared` if the stated errors are right.
    agree : bool
        False if the scatter is larger, or smaller, than the stated errors would give once in
        200 times. For `delay_correlation`, a whole number of samples, only a larger one counts.
    """

    name: str
    mean: Estimate
    values: tuple[float, ...]
    repeatability: float
    chi_squared: float
    freedom: int
    probability: float
    agree: bool

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, without the name."""
        return {name: value for name, value in fields_in(self).items() if name != "name"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RepeatedPair:
    """Result of all repeats for one input and one output.

    Parameters
    ----------
    input, output : str
        Names.
    structures : tuple of str
        Structure found in each repeat.
    parameters : tuple of RepeatedParameter
        Those that at least two repeats determine.
    frequency_response : FrequencyResponse
        Weighted by 1/std² at each frequency; its std follows from the weights, without any
        error that all repeats share.
    response_scatter : float
        R.m.s. scatter of the repeats' responses over their stated errors: near 1 if these are
        right.
    noise_std : Estimate or None
        Noise from the differences between repeats; None if fewer than two were identified.
    unmodelled : float or None
        R.m.s. part of the residual that recurs in every repeat, in the output's unit, less the
        noise that remains in the average.
    unmodelled_probability : float or None
        Probability of so much if there were noise only.
    findings : tuple of Finding
        Disagreements between the repeats.
    """

    input: str
    output: str
    structures: tuple[str, ...]
    parameters: tuple[RepeatedParameter, ...]
    frequency_response: FrequencyResponse
    response_scatter: float
    noise_std: Estimate | None
    unmodelled: float | None
    unmodelled_probability: float | None
    findings: tuple[Finding, ...]

    def __getitem__(self, name: str) -> RepeatedParameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        known = ", ".join(p.name for p in self.parameters)
        raise RecordError(f"the repeats do not determine {name!r}; they determine {known}")

    def __repr__(self) -> str:
        agree = sum(parameter.agree for parameter in self.parameters)
        what = f"{len(self.structures)} repeats, {agree} of {len(self.parameters)} parameters agree"
        return f"RepeatedPair({self._named}: {what})"

    def _repr_html_(self) -> str:
        """Return a table of the averages, for notebooks."""
        notes = [finding.message for finding in self.findings]
        return html_table(f"{self._named}: averages", _HEADS, self._rows, notes=notes)

    @property
    def _named(self) -> str:
        return f"{shortened([self.input])} → {shortened([self.output])}"

    @property
    def _rows(self) -> list[list[str]]:
        return [
            [p.name.replace("_", " "), p.mean.text, f"{p.repeatability:.2g} {p.mean.unit}".rstrip(),
             f"{percent(p.probability)} %", "yes" if p.agree else "no", p.mean.verdict]
            for p in self.parameters
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values; null for what is not finite."""
        own, scatter = fields_in(self), self.response_scatter
        own["parameters"] = {p.name: p.to_dict() for p in self.parameters}
        own["response_scatter"] = scatter if np.isfinite(scatter) else None
        own["warnings"] = own.pop("findings")
        return own


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Repeats:
    """Several records of one stimulus; index it output first: ``repeats["y", "u"]["delay"]``.

    Parameters
    ----------
    results : tuple of Identification
        Of each record alone.
    pairs : tuple of RepeatedPair
        Of all records together.
    """

    results: tuple[Identification, ...]
    pairs: tuple[RepeatedPair, ...]

    def __getitem__(self, key: tuple[str, str] | str) -> RepeatedPair:
        return find_pair(self.pairs, key, holder="the repeats")

    def __repr__(self) -> str:
        names = [pair._named for pair in self.pairs]
        return f"Repeats({len(self.results)} records: {shortened(names)})"

    def _repr_html_(self) -> str:
        """Return a table of the averages of every pair, for notebooks."""
        rows = [[pair._named, *row] for pair in self.pairs for row in pair._rows]
        messages = dict.fromkeys(f.message for pair in self.pairs for f in pair.findings)
        title = f"{len(self.results)} records of one stimulus"
        return html_table(title, ["from → to", *_HEADS], rows, notes=list(messages))

    def __iter__(self) -> Iterator[RepeatedPair]:
        return iter(self.pairs)

    def __len__(self) -> int:
        return len(self.pairs)

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain JSON values, `schema` first."""
        return {"schema": SCHEMA, **fields_in(self)}
