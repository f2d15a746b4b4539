"""Draws, failures, options and the command."""

import json
import os
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from families import study
from families.__main__ import main
from families.catalogue import FAMILIES, named
from families.study import draw_of, identified, model_response, one, run

import hmpim

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", ["second order", "mid-sweep", "PRBS held"])
def test_a_draw_depends_on_family_seed_and_index_alone(name):
    family = FAMILIES[name]
    first, again = draw_of(family, 3, 2), draw_of(family, 3, 2)
    other = draw_of(family, 4, 2)
    assert np.array_equal(first.outputs["y"][1], again.outputs["y"][1])
    assert {k: f.value for k, f in first.figures.items()} == {
        k: f.value for k, f in again.figures.items()
    }
    assert not np.array_equal(first.outputs["y"][1][:50], other.outputs["y"][1][:50])


def test_there_are_at_least_seventy_families_and_they_can_be_named():
    assert len(FAMILIES) >= 70
    assert named("static, sweep")[0] == "static"
    assert set(named("prbs")) == {n for n in FAMILIES if "prbs" in n.lower()}
    with pytest.raises(KeyError, match="perpetual motion"):
        named("static, perpetual motion")


@pytest.mark.parametrize("name", ["static", "first order", "PRBS held"])
def test_plain_records_are_right(name):
    found = run([name], draws=3, jobs=1)[name]
    assert all(score.cell in ("right_ok", "right_not_ok") for score in found)
    assert all(score.response < 0.05 for score in found)
    assert all(score.seconds > 0 for score in found)


def test_a_crash_and_a_refusal_are_counted(monkeypatch):
    def crash(_record):
        raise ZeroDivisionError("by 0")

    monkeypatch.setattr(hmpim, "identify", crash)
    found = one("static", 1, 0, True)
    assert (found.cell, found.failure) == ("no_answer", "ZeroDivisionError: by 0")
    assert all(figure.cell == "no_answer" for figure in found.figures.values())

    def refuse(_record):
        raise hmpim.HmpimError("too short")

    monkeypatch.setattr(hmpim, "identify", refuse)
    assert one("static", 1, 0, True).failure == "refused: too short"


def test_an_option_is_given_only_where_it_is_taken(monkeypatch):
    draw = replace(draw_of(FAMILIES["static"], 1, 0), options={"reference": "r"})
    given = []
    monkeypatch.setattr(hmpim, "identify", lambda record: given.append({}))
    identified(draw)
    monkeypatch.setattr(
        hmpim, "identify", lambda record, reference=None: given.append({"reference": reference})
    )
    identified(draw)
    identified(draw, options=False)
    assert given == [{}, {"reference": "r"}, {"reference": None}]


def test_the_response_of_a_result_is_that_of_its_coefficients(monkeypatch):
    """Through the package's model, or by hand where it makes none of the result."""
    draw = draw_of(FAMILIES["first order"], 1, 0)
    pair = identified(draw).pairs[0]
    f = np.array([0.0, 1.0, 7.0])
    through = model_response(pair, f)
    assert np.max(np.abs(through - draw.response.at(f))) < 0.02 * abs(through[0])

    def refuse(_pair):
        raise hmpim.HmpimError("not to be simulated")

    monkeypatch.setattr(hmpim, "to_model", refuse)
    assert model_response(pair, f) == pytest.approx(through)


def test_the_command_writes_counts_that_it_can_be_held_against(tmp_path):
    out, detail = tmp_path / "counts.json", tmp_path / "detail.json"
    command = [sys.executable, "benchmarks/families", "--families", "static", "--draws", "1"]
    done = subprocess.run(
        [*command, "--jobs", "1", "--json", str(out), "--against", str(out),
         "--detail", str(detail)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Moved since" in done.stdout
    assert out.is_file()
    assert json.loads(detail.read_text(encoding="utf-8"))["static"][0]["cell"] == "right_ok"


def test_the_command_refuses_a_family_that_is_not_there(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["families", "--families", "perpetual motion"])
    assert main() == 2
    wrong = capsys.readouterr()
    assert wrong.out == ""
    assert "no family is called 'perpetual motion'" in wrong.err


def test_a_draw_that_takes_too_long_is_a_failure(monkeypatch):
    monkeypatch.setattr(study, "PATIENCE", 0.05)

    def slow(_record):
        while True:
            np.linalg.svd(np.ones((50, 50)))

    monkeypatch.setattr(hmpim, "identify", slow)
    assert one("static", 1, 0, True).failure.startswith("TimeoutError")


def dies_at_one(name, seed, index, options, samples):
    """In a process of its own."""
    if index == 1:
        os._exit(1)
    return one(name, seed, index, options)


def test_a_draw_that_takes_its_process_down_is_a_crash_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(study, "one", dies_at_one)
    monkeypatch.setattr(
        study, "ProcessPoolExecutor", partial(ProcessPoolExecutor, mp_context=get_context("fork"))
    )
    found = run(["static, PRBS"], draws=3, jobs=2)["static, PRBS"]
    assert [score.failure for score in found] == ["", "its process died", ""]
    assert all(figure.cell == "no_answer" for figure in found[1].figures.values())
