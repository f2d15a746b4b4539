"""Every code that a finding may have stands in a table of the documents, with what it touches."""

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from hmpim.rigs.tracker.rig import findings_of

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "hmpim"
DOCS = {name: (ROOT / "docs" / f"{name}.md").read_text() for name in ("method", "rigs", "formats")}
ROWS = {
    name: [
        [cell.strip() for cell in line.split("|")[1:-1]]
        for line in text.partition(start)[2].splitlines()
        if line.startswith("| `")
    ]
    for name, text, start in (
        ("method", DOCS["method"], "## Verdict and warnings"),
        ("rigs", DOCS["rigs"], "A run adds these findings"),
        ("formats", DOCS["formats"], "Whatever is missing from a file"),
    )
}
ELSEWHERE = {
    "identify/nonlinear/modelled.py": "a kind of nonlinearity: docs/nonlinearity.md",
    "identify/nonlinear/nonlinearity.py": "a kind of nonlinearity: docs/nonlinearity.md",
    "rigs/tracker/rig.py": "asked for below",
}


def codes_in(cell):
    return set(re.findall(r"`(\w+)`", cell))


def strings(node):
    return {n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and n.value}


def spelt_out(given, function, tree):
    """Codes that an expression may stand for: words, a parameter's, or those of a loop."""
    if not isinstance(given, ast.Name):
        wrong = isinstance(given, ast.Attribute | ast.JoinedStr | ast.Subscript)
        return set() if wrong else strings(given)
    names = [argument.arg for argument in function.args.args]
    if given.id in names:
        at = names.index(given.id)
        return {
            code
            for call in ast.walk(tree)
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == function.name
            for code in strings(call.args[at])
        }
    loops = [n for n in ast.walk(function) if isinstance(n, ast.For)]
    (loop,) = [
        n for n in loops if given.id in {t.id for t in ast.walk(n.target) if hasattr(t, "id")}
    ]
    at = [target.id for target in loop.target.elts].index(given.id)
    return {code for each in loop.iter.elts for code in strings(each.elts[at])}


@cache
def said():
    """Place, codes and severity of every finding that the code makes."""
    found = []
    for file in sorted(SOURCE.rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "Finding(" not in text:
            continue
        tree = ast.parse(text)
        for function in ast.walk(tree):
            if not isinstance(function, ast.FunctionDef):
                continue
            for node in ast.walk(function):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                    given = {k.arg: k.value for k in node.keywords}
                    codes = spelt_out(given["code"], function, tree)
                    place = file.relative_to(SOURCE).as_posix()
                    found.append((place, codes, ast.unparse(given["severity"])))
    return found


def all_codes():
    return {code for _, codes, _ in said() for code in codes}


def test_the_code_was_read():
    assert {place for place, codes, _ in said() if not codes} == set(ELSEWHERE)
    assert len(all_codes()) > 60
    assert {"stray_stamps", "digest", "tick", "mixed_stamps"} <= all_codes()


def test_every_code_stands_in_a_table():
    tables = {"identify": "method", "record": "method", "formats": "formats"}
    named = {
        name: {code for row in rows for code in codes_in(row[0])} for name, rows in ROWS.items()
    }
    named["formats"] |= named["method"]  # our own record file's are beside the record's
    for place, codes, _ in said():
        assert codes <= named[tables.get(place.partition("/")[0], "rigs")], place


def test_a_trackers_frames():
    counts = dict.fromkeys(("frames", "dropped", "repeated", "lost"), 1)
    named = {code for row in ROWS["rigs"] for code in codes_in(row[0])}
    assert {found.code for found in findings_of(counts)} <= named


@pytest.mark.parametrize("name", ["rigs", "formats"])
def test_no_row_is_of_a_code_that_is_not_used_and_each_says_whether_it_is_a_doubt(name):
    doubted = {code for _, codes, severity in said() for code in codes if severity != "'info'"}
    for row in ROWS[name]:
        if len(row) == 4:
            for code in codes_in(row[0]) - {f"frames_{w}" for w in ("dropped", "repeated", "lost")}:
                assert code in all_codes()
                assert (row[2] != "–") == (code in doubted), row
