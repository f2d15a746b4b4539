"""A page of the documents is followed: its files are written, its commands and snippets run.

A block of TOML or Python under a line that ends with "`NAME`:" is a file. A block `console` holds
commands and lines of what they print: the words of a line must stand in one line of the output,
in their order, numbers to two parts in a thousand or to the last digit shown; … stands for what
is left out. A backslash at the end of a line continues a command. Other Python is executed, in
one space for the whole page, and prints what stands in the block `text` below it.
"""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

BLOCK = re.compile(r"(?P<before>[^\n]*)\n\n```(?P<kind>\w+)\n(?P<text>.*?)```", re.DOTALL)
NAMED = re.compile(r"`(?P<name>[\w.-]+\.\w+)`:$")
NUMBER = re.compile(r"^-?\d+(\.\d+)?(e[-+]?\d+)?$")


def follow(page: Path) -> None:
    """Do what a page says, in the folder that is current."""
    space: dict[str, object] = {"__name__": "page"}
    printed = ""
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        kind, text = block["kind"], block["text"]
        named = NAMED.search(block["before"])
        if named and kind in ("toml", "python"):
            Path(named["name"]).write_text(text, encoding="utf-8")
        elif kind == "console":
            command(text)
        elif kind == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(text, page.name, "exec"), space)
            printed = out.getvalue()
        elif kind == "text":
            said(text.splitlines(), printed)


def command(text: str) -> None:
    """Run each line that begins with $, and look for those below it in what it prints."""
    for part in re.split(r"^\$ ", text.replace("\\\n", " "), flags=re.MULTILINE)[1:]:
        line, *lines = part.splitlines()
        program, *words = shlex.split(line)
        assert program == "hmpim", line
        done = CliRunner().invoke(app, words, env={"COLUMNS": "160"})
        assert done.exit_code == 0, (line, done.stderr, done.stdout)
        said(lines, done.stdout)


def said(lines: list[str], printed: str) -> None:
    """Each line's words stand in one line of what was printed, in this order."""
    rows = [row.split() for row in printed.splitlines()]
    for line in lines:
        words = [word for word in line.split() if word != "…"]
        assert any(follows(words, row) for row in rows), (line, printed)


def follows(words: list[str], row: list[str]) -> bool:
    rest = iter(row)
    return all(any(alike(word, found) for found in rest) for word in words)


def alike(word: str, found: str) -> bool:
    if NUMBER.match(word) and NUMBER.match(found):
        last = 10.0 ** -len(word.partition(".")[2])
        return float(found) == pytest.approx(float(word), rel=2e-3, abs=0.6 * last)
    return word == found
