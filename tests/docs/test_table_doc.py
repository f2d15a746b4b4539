"""docs/table.md: its code runs, and its tables are what the code makes now."""

import importlib.util
import re
from itertools import product
from pathlib import Path

import pytest

from docs_following import snippet
from hmpim.rigs.table import AXES
from tests_support import in_studies

pytest.importorskip("mujoco", reason="the table needs the extra 'table'")

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "table.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def study():
    path = ROOT / "benchmarks" / "table_study.py"
    spec = importlib.util.spec_from_file_location("table_study", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def part(name):
    return TEXT.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end of {name} -->\n")[0]


def test_specification_and_exact_bandwidths_are_those_of_the_code(study):
    assert part("specification") == study.specification()
    assert part("exact") == study.exact_table()


ROWS = [line for line in part("agreement").splitlines() if line.startswith("| P")]
CASES = [tuple(cell.strip() for cell in row.split("|")[1:3]) for row in ROWS]
NUMBER = re.compile(r"[+-]?\d+\.\d+")


def test_fifteen_cases_stand_there():
    assert list(product(("P", "PV", "PVA"), AXES)) == CASES


@pytest.mark.parametrize("case", [("P", "pitch"), *in_studies(*((c,) for c in CASES))])
def test_a_case_made_again_is_the_one_that_stands_there(study, case):
    """Values within a standard deviation and a digit: another machine rounds otherwise."""
    row, off = study.compared_case(*case, fs=1000.0, share=0.95)
    assert off < 2.0
    made, said = (
        [float(number) for number in NUMBER.findall(text)]
        for text in (row, ROWS[CASES.index(case)])
    )
    exact, fitted, std, _, read, read_std, _ = said
    assert made[0] == pytest.approx(exact, abs=0.011)
    assert made[1] == pytest.approx(fitted, abs=std + 0.011)
    assert made[4] == pytest.approx(read, abs=read_std + 0.011)
    assert (made[2], made[5]) == pytest.approx((std, read_std), rel=0.3, abs=0.011)


def test_the_code_runs_and_says_what_stands_there():
    code = snippet("table.md", "import numpy")
    said = float(re.search(r"bandwidth_phase90  # ([\d.]+) Hz", code)[1])
    space = {}
    exec(compile(code, "docs/table.md", "exec"), space)
    assert space["found"].bandwidth_phase90.value == pytest.approx(said, abs=0.06)
    assert {c.name for c in space["record"].outputs} == {"roll.position", "pitch.position"}


def test_pictures_are_there():
    names = re.findall(r"\((images/[\w.-]+)\)", TEXT)
    assert names
    for name in names:
        assert (ROOT / "docs" / name).read_bytes().startswith(b"\x89PNG")
