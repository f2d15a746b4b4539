"""A Monte Carlo study in figures: errors over the bound, coverage, right and wrong by verdict."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.batch.montecarlo.plan import Plan
from hmpim.batch.rows import PARAMETERS

__all__ = ["FAR", "MonteCarlo", "ParameterScore", "Region", "Share", "sum_up"]

FAR = 5.0
"""Standard deviations from the truth beyond which a figure is wrong: 1 in two million by chance."""

_QUARTERS = 4
_EITHER = ("delay", "scale_factor", "bias")
"""Parameters that mean the same whatever the structure."""

Real = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """A share of a number of cases, with its 95 % interval (Wilson, 1927)."""

    share: float
    low: float
    high: float
    count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterScore:
    """One parameter over all draws whose structure was found.

    Parameters
    ----------
    name : str
        Which.
    rms : float
        Root of the mean square error.
    over_bound : float
        Root of the mean square of error over bound; NaN where there is none.
    coverage : Share
        How often the 95 % interval holds the truth.
    """

    name: str
    rms: float
    over_bound: float
    coverage: Share


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """The draws in one quarter of a quantity.

    Parameters
    ----------
    quantity : str
        Such as ``system.delay``.
    low, high : float
        Its range.
    over_bound : float
        Root of the mean square of error over bound, all parameters together.
    coverage : Share
        Of all parameters together.
    right_structure, ok : Share
        How often the structure is right, and the verdict ``ok``.
    silent : int
        Wrong, and the verdict is ``ok``.
    """

    quantity: str
    low: float
    high: float
    over_bound: float
    coverage: Share
    right_structure: Share
    ok: Share
    silent: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MonteCarlo:
    """A study in figures.

    Parameters
    ----------
    draws : int
        How many.
    parameters : tuple of ParameterScore
        Those that any draw has.
    verdicts : mapping of str to (int, int)
        By verdict: right and wrong draws. Wrong is more than 5 standard deviations from the truth
        in any parameter; of another structure than the true one, in delay, scale factor or bias.
    right_structure : Share
        How often the structure is right.
    regions : tuple of Region
        Quarters of the plan's quantities.
    reasons : tuple of str
        Why draws were not identified.
    """

    draws: int
    parameters: tuple[ParameterScore, ...]
    verdicts: Mapping[str, tuple[int, int]]
    right_structure: Share
    regions: tuple[Region, ...]
    reasons: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain JSON values; null for what is not a number."""
        return {"schema": "hmpim/montecarlo/1", **_plain(asdict(self))}


def sum_up(plan: Plan, table: Any) -> MonteCarlo:
    """Sum a study up.

    Parameters
    ----------
    plan : Plan
        What was drawn.
    table : pyarrow.Table
        From `run_montecarlo`.
    """
    structure, true = (np.array(_words(table, n)) for n in ("structure", "structure_true"))
    verdict = np.array(_words(table, "verdict"))
    right_structure = structure == true
    scores = {name: _Errors(table, name) for name in PARAMETERS}
    wrong = np.zeros(table.num_rows, dtype=bool)
    for name, errors in scores.items():
        counted = right_structure if name not in _EITHER else structure != ""
        wrong |= counted & errors.there & (np.abs(errors.error) > FAR * errors.std)
        # A parameter that there is and that was not found is no error: it is not told.
    found = {name: e for name, e in scores.items() if (e.there & right_structure).any()}
    kinds = [k for k in ("ok", "doubtful", "not_identifiable") if (verdict == k).any()]
    return MonteCarlo(
        draws=table.num_rows,
        parameters=tuple(e.score(name, right_structure) for name, e in found.items()),
        verdicts={
            k: (int(((verdict == k) & ~wrong).sum()), int(((verdict == k) & wrong).sum()))
            for k in kinds
        },
        right_structure=_share(right_structure),
        regions=tuple(
            region
            for quantity in plan.regions
            for region in _quarters(quantity, table, found, right_structure, verdict, wrong)
        ),
        reasons=tuple(sorted({r for r in _words(table, "reason") if r})),
    )


class _Errors:
    """Errors of one parameter over all draws."""

    def __init__(self, table: Any, name: str) -> None:
        value, true = _numbers(table, name), _numbers(table, f"{name}_true")
        self.error, self.std = value - true, _numbers(table, f"{name}_std")
        self.there = np.isfinite(self.error)
        self.bound = _numbers(table, f"{name}_bound")
        low, high = (_numbers(table, f"{name}_{end}") for end in ("low", "high"))
        told = np.isfinite(low) | np.isfinite(high)
        inside = ~(low > true) & ~(high < true)  # an open end is NaN, and holds
        self.inside = np.where(told, inside, True) & self.there

    def over(self, some: NDArray[np.bool_]) -> Real:
        """Errors over bounds, where there are some."""
        kept = self.there & some & (self.bound > 0)
        return np.asarray(self.error[kept] / self.bound[kept])

    def score(self, name: str, some: NDArray[np.bool_]) -> ParameterScore:
        kept = self.there & some
        return ParameterScore(
            name=name,
            rms=_rms(self.error[kept]),
            over_bound=_rms(self.over(some)),
            coverage=_share(self.inside[kept]),
        )


def _quarters(
    quantity: str,
    table: Any,
    found: Mapping[str, _Errors],
    right: NDArray[np.bool_],
    verdict: NDArray[np.str_],
    wrong: NDArray[np.bool_],
) -> list[Region]:
    values = _numbers(table, quantity)
    edges = np.quantile(values, np.linspace(0.0, 1.0, _QUARTERS + 1))
    out = []
    for k in range(_QUARTERS):
        last = k == _QUARTERS - 1
        here = (values >= edges[k]) & ((values <= edges[k + 1]) if last else values < edges[k + 1])
        if not here.any():
            continue
        over = [e.over(here & right) for e in found.values()]
        inside = [e.inside[e.there & here & right] for e in found.values()]
        out.append(
            Region(
                quantity=quantity,
                low=float(edges[k]),
                high=float(edges[k + 1]),
                over_bound=_rms(np.concatenate(over)),
                coverage=_share(np.concatenate(inside)),
                right_structure=_share(right[here]),
                ok=_share(verdict[here] == "ok"),
                silent=int((here & wrong & (verdict == "ok")).sum()),
            )
        )
    return out


def _share(flags: NDArray[np.bool_]) -> Share:
    count = int(flags.size)
    if not count:
        return Share(share=float("nan"), low=0.0, high=1.0, count=0)
    z, p = float(-scipy.special.ndtri(0.025)), float(flags.mean())
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * np.sqrt(p * (1 - p) / count + z * z / (4 * count**2))
    return Share(share=p, low=float(middle - half), high=float(middle + half), count=count)


def _rms(values: Real) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def _numbers(table: Any, name: str) -> Real:
    column = table.column(name)
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _words(table: Any, name: str) -> list[str]:
    return [word or "" for word in table.column(name).to_pylist()]


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
