"""docs/stimulus.md: its code runs, prints what it says, and draws the pictures it shows."""

import contextlib
import io
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app
from tests_support import c_compiler

DOC = Path(__file__).parents[2] / "docs" / "stimulus.md"
IMAGES = DOC.parent / "images" / "stimulus"
_BLOCK = re.compile(r"```python\n(.*?)```\n(?:\n```text\n(.*?)```)?", re.DOTALL)


def blocks_of(text):
    return [(code, said or "") for code, said in _BLOCK.findall(text)]


def test_every_block_runs_and_prints_what_stands_below_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = DOC.read_text(encoding="utf-8")
    space = {}
    for number, (code, said) in enumerate(blocks_of(text), start=1):
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
    (script,) = re.findall(r"```sh\n(.*?)```", DOC.read_text(encoding="utf-8"), re.DOTALL)
    design, compiled = script.replace("\\\n", " ").splitlines()
    program, *words = shlex.split(design)
    assert program == "hmpim"
    assert CliRunner().invoke(app, words).exit_code == 0
    subprocess.run(compiled, shell=True, check=True)
    samples = np.genfromtxt("samples.csv", delimiter=",", names=True)
    assert np.max(np.abs(samples["position"])) == pytest.approx(10.0, rel=1e-3)
    assert np.max(np.abs(samples["acceleration"])) <= 40000.0
