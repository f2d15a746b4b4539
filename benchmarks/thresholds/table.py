"""docs/thresholds.md: each number, where it comes from, and what 30 % of it does."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from thresholds.constants import Constant, constants

__all__ = ["EFFECTS", "PAGE", "origins", "page"]

HERE = Path(__file__).parent
ORIGINS, EFFECTS = HERE / "origins.toml", HERE / "effects.json"
PAGE = HERE.parents[1] / "docs" / "thresholds.md"

_INTRO = """# Thresholds

Every number with a name in `hmpim.identify`, and where it comes from.
`python benchmarks/thresholds` makes this page by `benchmarks/thresholds/origins.toml`, which says
what class a number belongs to.

- **Chance levels** follow from two numbers of `hmpim.identify.chance`: a test accuses a sound
  record in 1 of 10 000 cases, and intervals hold the truth in 95 %.
- **Tuned** numbers are held by the study named. The aim is at most twenty; **{tuned} are left**.
  {none} of them change the class of no draw below by 30 % either way.
- **Arithmetic**: rounding, sizes, caps on iterations, where a search begins and how finely it
  looks.

What is made of a number, such as `TWICE**2` or `1 - FEW`, moves with it and is not counted again.
Without a name, comparisons hold counts, halves, doubles and rounding (up to 1e-6, or from 1e6) and
no other number: a test reads the source.

{records}
"""


def origins() -> tuple[list[str], dict[str, str], list[str]]:
    """Keys of the chance levels, of the tuned numbers with their study, and of the others."""
    read = tomllib.loads(ORIGINS.read_text())
    tuned = {key: group["study"] for group in read["tuned"] for key in group["numbers"]}
    return read["chance"], tuned, read["arithmetic"]


def entries(some: Sequence[Constant], known: Sequence[str]) -> dict[str, str]:
    """The entry of each number: by file and name, or by name where it has moved to another file."""
    keys = {one.key for one in some}
    out = {key: key for key in keys if key in known}
    stale = [key for key in known if key not in keys]
    for key in keys - out.keys():
        same = [one for one in stale if one.split(":")[1] == key.split(":")[1]]
        if len(same) == 1:
            out[key] = same[0]
    return out


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _row(one: Constant, *more: str) -> str:
    text = one.text if len(one.text) < 40 else one.text[:37] + "..."
    return "| " + " | ".join([f"`{one.name}`", one.file, f"`{_cell(text)}`", *more]) + " |"


def _effect(effect: Mapping[str, Any] | None, end: str) -> str:
    if effect is None:
        return "not run"
    right, wrong, other = effect[end]
    if not (right or wrong or other):
        return "–"
    said = f"{right:+d}, {wrong:+d}" if right or wrong else "0, 0"
    return said + (f" ({other} draws move)" if other else "")


def _records(run: Mapping[str, Any]) -> str:
    if not run:
        return "The draws have not been run."
    return f"""The draws: {run["draws"]} of the study of families (`docs/accuracy.md`), the first
{run["each"]} of each family under seed 1; {run["right_ok"]} are right & `ok`,
{run["wrong_ok"]} wrong & `ok`.
*Decides in*: draws in which 30 % less or more turns a comparison; nothing changes in the others.
It is 0 too where no draw gets there: several inputs at once, fleets, live estimates.
The last two columns: change of the draws that are right & `ok` and wrong & `ok`, and in brackets
the draws that change their class at all; – is none. *Not run*: numbers that
decide in some draws, which
`python benchmarks/thresholds --measure --draws {run["each"]}` identifies again."""


def page(effects: Mapping[str, Any] | None = None) -> str:
    """The page."""
    if effects is None:
        effects = json.loads(EFFECTS.read_text()) if EFFECTS.exists() else {}
    chance, tuned, arithmetic = origins()
    run, numbers = effects.get("run", {}), effects.get("numbers", {})
    rows: dict[str, list[str]] = {"chance": [], "tuned": [], "arithmetic": []}
    still = 0
    some = constants()
    entry = entries(some, [*chance, *tuned, *arithmetic])
    for one in some:
        if one.key not in entry:
            raise KeyError(f"{one.key} is in no class: add it to {ORIGINS.name}")
        key = entry[one.key]
        if key not in tuned:
            rows["chance" if key in chance else "arithmetic"].append(_row(one, _cell(one.says)))
            continue
        effect = numbers.get(key)
        still += effect is not None and not any((*effect["less"], *effect["more"]))
        decides = str(run["moved"].get(key, "?")) if run else "?"
        ends = (_effect(effect, "less"), _effect(effect, "more"))
        rows["tuned"].append(_row(one, _cell(one.says), f"`{tuned[key]}`", decides, *ends))
    head = _INTRO.format(tuned=len(rows["tuned"]), none=still, records=_records(run))
    plain = ["| number | file | value | what it says |", "| --- | --- | --- | --- |"]
    wide = [
        "| number | file | value | what it decides | study | decides in | −30 % | +30 % |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    parts = [
        head,
        "## Tuned\n",
        *wide,
        *rows["tuned"],
        "\n## Chance levels\n",
        *plain,
        *rows["chance"],
        "\n## Arithmetic\n",
        *plain,
        *rows["arithmetic"],
    ]
    return "\n".join(parts) + "\n"
