"""Each how-to is followed, command by command, and finds what it prints."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import howto_files
from hmpim.cli.main import app

FOLDER = Path(__file__).parents[2] / "docs" / "howto"
BLOCK = re.compile(r"```console\n\$ hmpim (?P<command>[^\n]+)\n(?P<lines>.*?)```", re.S)
NUMBER = re.compile(r"^-?\d+(\.\d+)?(e[-+]?\d+)?$")
TRUTH = {
    "Delay, pure": howto_files.DELAY,
    "Natural frequency": howto_files.NATURAL_FREQUENCY,
}


def follows(words, row):
    """Whether the words stand in a row in this order; numbers to two parts in a thousand."""
    row = iter(row)
    return all(any(alike(word, found) for found in row) for word in words)


def alike(word, found):
    if NUMBER.match(word) and NUMBER.match(found):
        return float(found) == pytest.approx(float(word), rel=2e-3)
    return word == found


@pytest.mark.parametrize("name", howto_files.FILES)
def test_a_how_to_does_what_it_prints(name, tmp_path, monkeypatch):
    howto_files.FILES[name](tmp_path)
    monkeypatch.chdir(tmp_path)
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8").replace("\\\n", " ")
    blocks = list(BLOCK.finditer(text))
    assert blocks
    for block in blocks:
        done = CliRunner().invoke(app, shlex.split(block["command"]))
        assert done.exit_code == 0, done.stderr
        rows = [line.split() for line in done.stdout.splitlines()]
        for line in block["lines"].splitlines():
            assert any(follows(line.split(), row) for row in rows), (line, done.stdout)
            for words, truth in TRUTH.items():
                if line.startswith(words):
                    figure = next(float(w) for w in line.split() if NUMBER.match(w))
                    assert figure == pytest.approx(truth, rel=5e-3)
