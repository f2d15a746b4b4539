"""Counts, bounds and the table of families."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta, binomtest

from families.scoring import CELLS, OFF, Score

__all__ = ["at_least", "at_most", "markdown", "moved", "read", "summary", "write", "write_detail"]

LEVEL = 0.05
NOMINAL = 0.95
ONE_SIDED = 0.93


def at_least(hits: int, of: int, *, level: float = LEVEL) -> float:
    """Clopper and Pearson's lower 95 % bound of a rate, one-sided."""
    return 0.0 if hits == 0 else float(beta.ppf(level, hits, of - hits + 1))


def at_most(hits: int, of: int, *, level: float = LEVEL) -> float:
    """The upper one."""
    return 1.0 if hits == of else float(beta.ppf(1 - level, hits + 1, of - hits))


_COUNTS = ("tellable", *CELLS, "ok", "ok_held", "doubtful", "doubtful_held", "hull")


def summary(scores: Sequence[Score]) -> dict[str, Any]:
    """Counts of one family: draws by cell, figures by cell and verdict, time."""
    cells = {cell: sum(s.cell == cell for s in scores) for cell in CELLS}
    told = dict.fromkeys(CELLS, 0)
    figures: dict[str, dict[str, int]] = {}
    for s in scores:
        for name, f in s.figures.items():
            row = figures.setdefault(name, dict.fromkeys(_COUNTS, 0))
            row["tellable"] += f.tellable
            if f.tellable:
                told[f.cell] += 1
            if f.tellable or f.cell.startswith("wrong"):
                row[f.cell] += 1
            if f.holds is not None:
                kind = "ok" if f.ok else "doubtful"
                row[kind] += 1
                row[f"{kind}_held"] += f.holds
                row["hull"] += f.hull and f.ok
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
        "response_off": sum(s.response is not None and not s.response <= OFF for s in scores),
        "measured_off": sum(bool(s.measured_off) for s in scores),
        "failures": failures,
        "seconds": [round(seconds[len(seconds) // 2], 3), round(seconds[-1], 3)],
    }


def is_hull(row: Mapping[str, Any]) -> bool:
    """Whether a fifth of a family's intervals called ok span what cannot be told apart."""
    figures = row["figures"].values()
    return sum(f["hull"] for f in figures) > 0.2 * max(sum(f["ok"] for f in figures), 1)


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
        one_sided = is_hull(row)
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
    return [*lines, "", *totals(rows), "", *by_figure(rows)]


def by_figure(rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The same by figure, over all families."""
    total: dict[str, dict[str, int]] = {}
    for row in rows.values():
        for name, counts in row["figures"].items():
            mine = total.setdefault(name, dict.fromkeys(_COUNTS, 0))
            for key in _COUNTS:
                mine[key] += counts[key]
    lines = [
        "| figure | can tell | of that right & `ok` | no answer | wrong & `ok` | wrong, not `ok` "
        "| `ok` hold | doubtful hold |",
        "| --- |" + " --- |" * 7,
    ]
    for name, n in total.items():
        lines.append(
            f"| `{name}` | {n['tellable']} | {_percent(n['right_ok'], n['tellable'], 1)} | "
            f"{_percent(n['no_answer'], n['tellable'], 1)} | {n['wrong_ok']} | "
            f"{n['wrong_not_ok']} | {_percent(n['ok_held'], n['ok'], 1)} of {n['ok']} | "
            f"{_percent(n['doubtful_held'], n['doubtful'], 1)} of {n['doubtful']} |"
        )
    return lines


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
        k for k, r in rows.items() if _rejected(*_covered(r, "ok"), len(rows), one_sided=is_hull(r))
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


def write(rows: Mapping[str, Mapping[str, Any]], path: Path, *, seed: int) -> None:
    """Counts as JSON, a family a line; what `read` and --against read.

    Families that a file holds already and that were not drawn now stay as they are.
    """
    lines = []
    if path.is_file():
        rows = read(path) | rows
    for name, row in rows.items():
        figures = {key: [n[c] for c in _COUNTS] for key, n in row["figures"].items()}
        lines.append(f"{json.dumps(name)}: {json.dumps({**row, 'figures': figures}, default=int)}")
    head = f'"seed": {seed}, "counts": {json.dumps(_COUNTS)}'
    text = "{" + head + ', "families": {\n' + ",\n".join(lines) + "\n}}\n"
    path.write_text(text, encoding="utf-8")


def read(path: Path) -> dict[str, dict[str, Any]]:
    """Counts that `write` wrote."""
    found = json.loads(path.read_text(encoding="utf-8"))
    for row in found["families"].values():
        row["figures"] = {
            key: dict.fromkeys(_COUNTS, 0) | dict(zip(found["counts"], n, strict=True))
            for key, n in row["figures"].items()
        }
    return dict(found["families"])


def write_detail(scores: Mapping[str, Sequence[Score]], path: Path) -> None:
    """Every draw as JSON."""
    plain = {name: [asdict(score) for score in found] for name, found in scores.items()}
    path.write_text(json.dumps(plain, default=np.generic.item) + "\n", encoding="utf-8")
