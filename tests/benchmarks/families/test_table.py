"""Counts, bounds, and what moved."""

import pytest
from families.scoring import Score, Scored
from families.table import at_least, at_most, markdown, moved, read, summary, write

RIGHT = {"tellable": True, "ok": True, "cell": "right_ok"}


def scores(held, of, *, hull=False, cell="right_ok", failure=""):
    """One figure a draw."""
    return [
        Score(
            cell=cell,
            verdict="ok",
            figures={"delay": Scored(**RIGHT, holds=k < held, hull=hull)},
            failure=failure,
        )
        for k in range(of)
    ]


def line_of(lines, name):
    return next(line for line in lines if line.startswith(f"| {name}"))


def test_clopper_and_pearson():
    assert at_least(0, 50) == 0.0
    assert at_most(0, 50) == pytest.approx(1 - 0.05 ** (1 / 50))
    assert at_least(50, 50) == pytest.approx(0.05 ** (1 / 50))


@pytest.mark.parametrize(
    ("held", "hull", "rejected"),
    [(95, False, False), (80, False, True), (98, False, False), (80, True, True)],
)
def test_coverage_is_held_against_95_percent(held, hull, rejected):
    lines = markdown({"x": summary(scores(held, 100, hull=hull))})
    assert ("✗" in line_of(lines, "x")) is rejected
    assert ("†" in line_of(lines, "x")) is hull


def test_a_hull_may_hold_always():
    certain = markdown({"x": summary(scores(200, 200))})
    hull = markdown({"x": summary(scores(200, 200, hull=True))})
    assert "✗" in line_of(certain, "x")
    assert "✗" not in line_of(hull, "x")


def test_four_of_fifty_wrong_is_too_many_and_three_are_not():
    for wrong, bad in ((3, False), (4, True)):
        found = scores(50 - wrong, 50 - wrong) + scores(0, wrong, cell="wrong_ok")
        line = line_of(markdown({"x": summary(found)}), "x")
        assert ("✗" in line.split("|")[5]) is bad


def test_a_crash_is_named():
    crashed = scores(0, 2, cell="no_answer", failure="ZeroDivisionError: by 0")
    text = "\n".join(markdown({"x": summary(crashed + scores(3, 3))}))
    assert "Crash, 2 times: x: ZeroDivisionError: by 0" in text


def test_what_is_written_is_read_and_what_moved_is_said(tmp_path):
    old = {"x": summary(scores(10, 10)), "y": summary(scores(10, 10))}
    write(old, tmp_path / "old.json", seed=1)
    assert read(tmp_path / "old.json") == old
    write({"z": old["y"]}, tmp_path / "old.json", seed=1)
    assert read(tmp_path / "old.json") == old | {"z": old["y"]}
    write(old, tmp_path / "two.json", seed=1)
    new = old | {"y": summary(scores(10, 10, cell="wrong_ok")), "z": summary(scores(1, 1))}
    lines = moved(new, read(tmp_path / "two.json"))
    assert not any(line.startswith("| x ") for line in lines)
    assert "100 → 0" in line_of(lines, "y")
    assert "new" in line_of(lines, "z")
