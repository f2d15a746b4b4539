"""docs/thresholds.md lists every number with a name in `hmpim.identify`."""

import ast
from collections import Counter

import pytest
from thresholds import constants as numbers
from thresholds import watch
from thresholds.table import PAGE, entries, origins


def test_every_constant_of_identify_is_on_the_page_with_its_value():
    rows = [line.split(" | ") for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    listed = Counter((row[0].strip("|` "), row[2].strip(" `|").split("...")[0]) for row in rows)
    for one in numbers.constants():
        text = one.text if len(one.text) < 40 else one.text[:37]
        listed[one.name, text] -= 1
    missing = [key for key, left in listed.items() if left < 0]
    assert not missing, (
        "add to benchmarks/thresholds/origins.toml, run python benchmarks/thresholds"
    )


def test_every_constant_has_one_class():
    chance, tuned, arithmetic = origins()
    known = [*chance, *tuned, *arithmetic]
    some = numbers.constants()
    assert len(known) == len(set(known))
    assert {one.key for one in some} == entries(some, known).keys()


def test_no_comparison_of_identify_holds_a_number_that_has_no_name():
    found = {
        f"{path.relative_to(numbers.ROOT)}:{line}": value
        for path in sorted(numbers.ROOT.rglob("*.py"))
        for line, value in numbers.bare(path.read_text())
    }
    assert found == {}, "name it, with its origin in benchmarks/thresholds/origins.toml"


def test_a_number_that_moved_to_another_file_keeps_its_class():
    moved = numbers.Constant(file="new.py", name="_FAR", text="8.0", says="")
    assert entries([moved], ["old.py:_FAR", "old.py:_NEAR"]) == {"new.py:_FAR": "old.py:_FAR"}
    assert entries([moved], ["old.py:_FAR", "other.py:_FAR"]) == {}


@pytest.mark.parametrize(("limit", "moved"), [(1.0, {"key"}), (100.0, set())])
def test_a_comparison_that_turns_within_thirty_percent_is_noted(limit, moved):
    tree = ast.parse("def exceeds(x):\n    return x > _LIMIT\n")
    rewritten = watch._Rewrite({"_LIMIT": "key"}).visit(tree)
    names = {"_LIMIT": limit, "__watched__": watch._watched, "__used__": watch._used}
    exec(compile(ast.fix_missing_locations(rewritten), "made", "exec"), names)
    watch.NOTES.clear()
    assert names["exceeds"](0.9) is False
    assert watch.NOTES.moved == moved
    assert watch.NOTES.reached == {"key"}
    assert names["_LIMIT"] == limit
