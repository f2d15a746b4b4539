"""docs/stimulus.md: its code runs, prints what it says, and draws the pictures it shows."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

from docs_following import execute, lines_of, printing, snippet
from tests_support import c_compiler

DOC = Path(__file__).parents[2] / "docs" / "stimulus.md"
IMAGES = DOC.parent / "images" / "stimulus"


def test_every_block_runs_and_prints_what_stands_below_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = DOC.read_text(encoding="utf-8")
    space = {}
    for number, (code, said) in enumerate(printing("stimulus.md"), start=1):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, f"{DOC.name}, block {number}", "exec"), space)
        assert printed.getvalue() == said, f"block {number}"
    drawn = {path.name for path in tmp_path.glob("*.png")}
    shown = set(re.findall(r"images/stimulus/([\w-]+\.png)", text))
    assert drawn == shown
    assert all((tmp_path / name).read_bytes().startswith(b"\x89PNG") for name in drawn)


def test_pictures_shown_are_there():
    names = re.findall(r"images/stimulus/([\w-]+\.png)", DOC.read_text(encoding="utf-8"))
    assert len(names) >= 10
    assert not [name for name in names if not (IMAGES / name).is_file()]


def test_the_equations_are_written_compiled_and_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    c_compiler()
    for line in lines_of(snippet("stimulus.md", "hmpim design")):
        execute(line)
    samples = np.genfromtxt("samples.csv", delimiter=",", names=True)
    assert np.max(np.abs(samples["position"])) == pytest.approx(10.0, rel=1e-3)
    assert np.max(np.abs(samples["acceleration"])) <= 40000.0
