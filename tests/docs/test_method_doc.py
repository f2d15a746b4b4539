"""docs/method.md: its tables of warnings and of groups are what the code says."""

import ast
import inspect
import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from hmpim.identify.fitting.joint import chosen_of, joint_fit
from hmpim.identify.identify import identify_output
from hmpim.identify.result import groups
from hmpim.model.nonlinear import KIND_WORDS

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
WARNINGS = TEXT.partition("## Verdict and warnings")[2].partition("\n## ")[0]
ROWS = [
    [cell.strip() for cell in line.split("|")[1:-1]]
    for line in WARNINGS.splitlines()
    if line.startswith("| `")
]
TOUCHED = {code: row for row in reversed(ROWS) for code in re.findall(r"`(\w+)`", row[0])}
WORDS = {
    "EVERY": "everything",
    "MODELLED": "all of the model",
    "PHASE_SPLIT": "the split of the phase",
    "TIMING": "timing",
    "GAIN": "size",
}


class Said(NamedTuple):
    """A finding as it stands in the code: its codes, and what is written beside them."""

    codes: tuple[str, ...]
    severity: str
    parameters: str


def strings(node):
    return tuple(
        each.value
        for each in ast.walk(node)
        if isinstance(each, ast.Constant) and isinstance(each.value, str)
    )


@cache
def findings(room):
    """Every finding that a room's code makes with a code that stands there."""
    said = []
    for file in sorted((ROOT / "src" / "hmpim" / room).rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "Finding(" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                given = {k.arg: k.value for k in node.keywords}
                severity, touched = (ast.unparse(given[k]) for k in ("severity", "parameters"))
                said.append(Said(strings(given["code"]), severity, touched))
    return [one for one in said if one.codes]


def doubts():
    return [said for said in findings("identify") if said.severity != "'info'"]


def test_the_code_was_read():
    assert len(doubts()) > 20
    assert len(findings("record")) > 8


def test_every_code_stands_in_a_table():
    made = {code for said in findings("identify") + findings("record") for code in said.codes}
    assert not made - set(TOUCHED)


def test_what_a_doubt_touches_is_what_its_row_says():
    held = 0
    for said in doubts():
        for code in said.codes:
            for group in re.findall(r"\b[A-Z_]{4,}\b", said.parameters):
                if group in WORDS:
                    held += 1
                    assert WORDS[group] in TOUCHED[code][2], (code, group)
    assert held > 20


def test_what_is_never_a_doubt_touches_nothing():
    doubted = {code for said in doubts() for code in said.codes}
    for row in ROWS:
        if len(row) == 4 and not doubted & set(re.findall(r"`(\w+)`", row[0])):
            assert row[2] == "–", row


def test_what_the_record_file_says_of_itself():
    code = (ROOT / "src/hmpim/formats/recording/opened.py").read_text(encoding="utf-8")
    said = re.findall(r'_info\(\s*"(\w+)"', code)
    assert len(said) >= 4
    assert set(said) <= set(TOUCHED)


def test_the_kinds_of_nonlinearity_have_their_own_page():
    page = (ROOT / "docs" / "nonlinearity.md").read_text(encoding="utf-8")
    for kind in KIND_WORDS:
        assert f"`{kind}`" in page, kind


def members(cell):
    return set(re.findall(r"`(\w+)`", cell))


def test_the_groups_are_those_of_the_code():
    table = {
        line.split("|")[1].strip(): line.split("|")[2]
        for line in WARNINGS.partition("| group |")[2].partition("\n\n")[0].splitlines()[2:]
    }
    assert members(table["the split of the phase"]) == set(groups.PHASE_SPLIT)
    assert members(table["timing"]) == set(groups.TIMING)
    assert members(table["size"]) == {*groups.GAIN, "noise_std"}
    seen = set(groups.EVERY) - set(groups.MODELLED)
    assert members(table["all of the model"]) <= seen
    assert {name for name in seen if "saturation" not in name} == members(table["all of the model"])


@pytest.mark.parametrize(
    ("chapter", "function", "unsaid"),
    [
        ("The algorithm", identify_output, {"range", "describe_dead"}),
        ("The fit", joint_fit, {"software_fit"}),
        ("The fit", chosen_of, {"give_up", "settle"}),
    ],
)
def test_the_algorithm_stands_line_for_line_as_in_the_code(chapter, function, unsaid):
    text = TEXT.partition(f"## {chapter}\n")[2].partition("\n## ")[0]
    blocks = re.findall(r"```python\n(.*?)```\n", text, re.S)
    source = ast.parse(inspect.getsource(function)).body[0]
    assert isinstance(source, ast.FunctionDef)
    code = source.body[1:]  # without the docstring
    same = ast.dump(ast.Module(body=code, type_ignores=[]))
    assert same in [ast.dump(ast.parse(block)) for block in blocks]
    assert sum(len(block.splitlines()) for block in blocks) <= 15
    calls = [node.func for node in ast.walk(source) if isinstance(node, ast.Call)]
    called = {name.id for name in calls if isinstance(name, ast.Name)} - unsaid
    assert called <= set(re.findall(r"`(\w+)`", text))
