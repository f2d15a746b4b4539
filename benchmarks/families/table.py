"""Counts, bounds and the table of families."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import beta, binomtest

from families.catalogue import FAMILIES
from families.scoring import CELLS, Score

__all__ = ["at_least", "at_most", "markdown", "moved", "summary"]

LEVEL = 0.05
NOMINAL = 0.95
ONE_SIDED = 0.93


def at_least(hits: int, of: int, *, level: float = LEVEL) -> float:
    """Clopper and Pearson's lower 95 % bound of a rate, one-sided."""
    return 0.0 if hits == 0 else float(beta.ppf(level, hits, of - hits + 1))


def at_most(hits: int, of: int, *, level: float = LEVEL) -> float:
    """The upper one."""
    return 1.0 if hits == of else float(beta.ppf(1 - level, hits + 1, of - hits))


def summary(scores: Sequence[Score]) -> dict[str, Any]:
    """Counts of one family: draws by cell, figures by cell and verdict, time."""
    cells = {cell: sum(s.cell == cell for s in scores) for cell in CELLS}
    told = dict.fromkeys(CELLS, 0)
    figures: dict[str, dict[str, int]] = {}
    response = [s.response for s in scores if s.response is not None]
    for s in scores:
        for name, f in s.figures.items():
            row = figures.setdefault(
                name,
                {
                    "ok_held": 0,
                    "ok": 0,
                    "doubtful_held": 0,
                    "doubtful": 0,
                    "tellable": 0,
                    "right_ok": 0,
                    "wrong_ok": 0,
                },
            )
            if f.tellable:
                told[f.cell] += 1
                row["tellable"] += 1
                row["right_ok"] += f.cell == "right_ok"
            row["wrong_ok"] += f.cell == "wrong_ok"
            if f.holds is not None:
                kind = "ok" if f.ok else "doubtful"
                row[kind] += 1
                row[f"{kind}_held"] += f.holds
    failures: dict[str, int] = {}
    for s in scores:
        if s.failure:
            text = s.failure[:100]
            failures[text] = failures.get(text, 0) + 1
    seconds = sorted(s.seconds for s in scores)
    return {
        "draws": len(scores),
        "cells": cells,
        "told": told,
        "figures": figures,
        "response_off": sum(r > 0.05 for r in response),
        "measured_off": sum(bool(s.measured_off) for s in scores),
        "failures": failures,
        "seconds": [round(seconds[len(seconds) // 2], 3), round(seconds[-1], 3)],
    }


def _covered(row: Mapping[str, Any], kind: str) -> tuple[int, int]:
    figures = row["figures"].values()
    return sum(f[f"{kind}_held"] for f in figures), sum(f[kind] for f in figures)


def _percent(hits: int, of: int, digits: int = 0) -> str:
    return "–" if of == 0 else f"{100 * hits / of:.{digits}f}"


def _rejected(held: int, of: int, families: int, *, one_sided: bool) -> bool:
    """Exact binomial test of 95 % (93 %, one-sided, of hulls) at 5 % over all families."""
    if of == 0:
        return False
    if one_sided:
        p = binomtest(held, of, ONE_SIDED, alternative="less").pvalue
    else:
        p = binomtest(held, of, NOMINAL).pvalue
    return p < LEVEL / families


def markdown(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The table, a line a family, and what it adds up to."""
    lines = [
        "| family | draws | right & `ok` | right, not `ok` | **wrong & `ok`** | wrong, not `ok` "
        "| no answer | can tell | of that right & `ok` | `ok` hold | doubtful hold "
        "| measured off | s of processor, middle and most |",
        "| --- |" + " --- |" * 12,
    ]
    for name, row in rows.items():
        n, cells = row["draws"], row["cells"]
        held, of = _covered(row, "ok")
        doubt, doubts = _covered(row, "doubtful")
        told = sum(row["told"].values())
        one_sided = name in FAMILIES and FAMILIES[name].one_sided
        mark = " ✗" if _rejected(held, of, len(rows), one_sided=one_sided) else ""
        bad = " ✗" if at_least(cells["wrong_ok"], n) > 0.02 else ""
        numbers = [_percent(cells[cell], n) for cell in CELLS]
        numbers[2] += bad
        lines.append(
            f"| {name}{' †' if one_sided else ''} | {n} | "
            + " | ".join(numbers)
            + f" | {told} | {_percent(row['told']['right_ok'], told)} | "
            f"{_percent(held, of)} of {of}{mark} | {_percent(doubt, doubts)} of {doubts} | "
            f"{_percent(row['measured_off'], n)} | "
            f"{row['seconds'][0]:.2g}, {row['seconds'][1]:.2g} |"
        )
    return [*lines, "", *totals(rows)]


def totals(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Pooled rates against the goals."""
    n = sum(r["draws"] for r in rows.values())
    cells = {cell: sum(r["cells"][cell] for r in rows.values()) for cell in CELLS}
    told = sum(sum(r["told"].values()) for r in rows.values())
    right = sum(r["told"]["right_ok"] for r in rows.values())
    held, of = map(sum, zip(*(_covered(r, "ok") for r in rows.values()), strict=True))
    doubt, doubts = map(sum, zip(*(_covered(r, "doubtful") for r in rows.values()), strict=True))
    wrong = cells["wrong_ok"]
    beyond = [k for k, r in rows.items() if at_least(r["cells"]["wrong_ok"], r["draws"]) > 0.02]
    rejected = [
        k
        for k, r in rows.items()
        if _rejected(
            *_covered(r, "ok"), len(rows), one_sided=k in FAMILIES and FAMILIES[k].one_sided
        )
    ]
    slowest = max(rows, key=lambda k: rows[k]["seconds"][1])
    failures = {
        f"{name}: {text}": count
        for name, r in rows.items()
        for text, count in r["failures"].items()
    }
    lines = [
        f"{len(rows)} families, {n} draws. "
        + "; ".join(f"{cell.replace('_', ' ')} {_percent(cells[cell], n, 1)} %" for cell in CELLS)
        + ".",
        "",
        f"- Wrong and `ok`: {_percent(wrong, n, 2)} % pooled (95 % bounds "
        f"{100 * at_least(wrong, n):.2f} to {100 * at_most(wrong, n):.2f} %; goal 0.5 %). "
        f"Lower bound above 2 % in {len(beyond)} families.",
        f"- Of {told} figures that the records can tell, {_percent(right, told, 1)} % are right "
        "and `ok` (goal 80 %).",
        f"- Intervals called `ok` hold in {_percent(held, of, 1)} % of {of} (goal 93 to 97 %); "
        f"{len(rejected)} families are rejected against 95 %. Doubtful ones hold in "
        f"{_percent(doubt, doubts, 1)} % of {doubts} (goal 90 %).",
        f"- Slowest: {slowest}, {rows[slowest]['seconds'][1]:.1f} s of processor for one record.",
    ]
    crashes = {t: c for t, c in failures.items() if ": refused: " not in t}
    lines += [f"- Crash, {count} times: {text}" for text, count in crashes.items()]
    return lines


def moved(rows: Mapping[str, Mapping[str, Any]], old: Mapping[str, Any]) -> list[str]:
    """What changed since an earlier run, family by family: percent then, percent now."""
    lines = [
        "| family | right & `ok` | wrong & `ok` | no answer | of what it can tell | `ok` hold |",
        "| --- |" + " --- |" * 5,
    ]
    for name, row in rows.items():
        before = old.get(name)
        if before is None:
            lines.append(f"| {name} | new |" + " |" * 4)
            continue

        def pair(a: str, b: str) -> str:
            return b if a == b else f"{a} → {b}"

        cells = [
            pair(*(_percent(r["cells"][cell], r["draws"]) for r in (before, row)))
            for cell in ("right_ok", "wrong_ok", "no_answer")
        ]
        told = pair(
            *(_percent(r["told"]["right_ok"], sum(r["told"].values())) for r in (before, row))
        )
        held = pair(*(_percent(*_covered(r, "ok")) for r in (before, row)))
        if any("→" in cell for cell in (*cells, told, held)):
            lines.append(f"| {name} | " + " | ".join([*cells, told, held]) + " |")
    return lines
