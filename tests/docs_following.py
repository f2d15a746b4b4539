"""The blocks that the documents show, and a page that is followed: its commands and snippets run.

A block of TOML or Python under a line that ends with "`NAME`:" is a file. A block `console` holds
commands and lines of what they print: the words of a line must stand in one line of the output,
in their order, numbers to two parts in a thousand or to the last digit shown; … stands for what
is left out. A backslash at the end of a line continues a command. Other Python is executed, in
one space for the whole page, and prints what stands in the block `text` below it.

All other blocks have a test of their own, which asks for them by how they begin (`snippet`), or a
reason why none executes them (tests/docs/test_every_snippet.py).
"""

import contextlib
import io
import re
import shlex
import subprocess
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
FOLLOWED = (
    "tutorial.md",
    "doubtful.md",
    "live.md",
    "software.md",
    "howto/motion-table.md",
    "howto/seeker.md",
    "howto/servo.md",
    "howto/drone.md",
    "howto/audio-loop.md",
    "howto/software.md",
    "howto/long-record.md",
)
"""Pages that make their own data."""

BLOCK = re.compile(r"^```(?P<kind>[^\n]*)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r"`(?P<name>[\w.-]+\.\w+)`:$")
NUMBER = re.compile(r"^-?\d+(\.\d+)?(e[-+]?\d+)?$")


@dataclass(frozen=True)
class Block:
    """What a page shows between two fences; `name` is that of a file that it is."""

    kind: str
    text: str
    name: str

    @property
    def followed(self) -> bool:
        """Whether `follow` does something with it."""
        return self.kind in ("console", "python", "text") or bool(self.kind == "toml" and self.name)


def page_of(name: str) -> Path:
    """README.md and CONTRIBUTING.md stand above the documents."""
    return ROOT / name if (ROOT / name).is_file() else DOCS / name


def blocks_of(name: str) -> list[Block]:
    """All blocks of a page, but those that are made for the site."""
    page = page_of(name).read_text(encoding="utf-8")
    found = []
    for block in BLOCK.finditer(page):
        before = page[: block.start()].rstrip("\n").rpartition("\n")[2]
        named = NAMED.search(before)
        if not block["kind"].startswith("{"):
            found.append(Block(block["kind"], block["text"], named["name"] if named else ""))
    return found


def snippet(name: str, beginning: str) -> str:
    """Return the one block of a page that begins so; the test that asks for it executes it."""
    (block,) = [block for block in blocks_of(name) if block.text.startswith(beginning)]
    return block.text


def printing(name: str) -> list[tuple[str, str]]:
    """Return each block of Python on a page, with what stands in the block `text` below it."""
    blocks = [block for block in blocks_of(name) if block.kind in ("python", "text")]
    below = [*blocks[1:], Block("", "", "")]
    return [
        (block.text, after.text if after.kind == "text" else "")
        for block, after in zip(blocks, below, strict=True)
        if block.kind == "python"
    ]


def follow(name: str) -> None:
    """Do what a page says, in the folder that is current."""
    space: dict[str, object] = {"__name__": "page"}
    printed = ""
    for block in blocks_of(name):
        if block.name and block.kind in ("toml", "python"):
            Path(block.name).write_text(block.text, encoding="utf-8")
        elif block.kind == "console":
            follow_commands(block.text)
        elif block.kind == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(block.text, name, "exec"), space)
            printed = out.getvalue()
        elif block.kind == "text":
            said(block.text.splitlines(), printed)


def follow_commands(text: str) -> None:
    """Run each line that begins with $, and look for those below it in what it prints."""
    for part in re.split(r"^\$ ", text.replace("\\\n", " "), flags=re.MULTILINE)[1:]:
        line, *lines = part.splitlines()
        said(lines, execute(line))


def lines_of(text: str) -> list[str]:
    """Return the commands of a block without prompts, one to a line."""
    return text.replace("\\\n", " ").splitlines()


def execute(line: str, *more: str, code: int = 0) -> str:
    """Run a line of a shell, hmpim in this process; return what it prints."""
    program, *words = shlex.split(line)
    if program == "hmpim":
        done = CliRunner().invoke(app, [*words, *more], env={"COLUMNS": "160"})
        assert done.exit_code == code, (line, done.stderr, done.stdout)
        return done.stdout
    ran = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
    assert ran.returncode == code, (line, ran.stderr)
    return ran.stdout


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


def published(folder: Path, toml: str) -> None:
    """Install what a block of entry points publishes, as pip does it, into a folder of the path."""
    groups = tomllib.loads(toml)["project"]["entry-points"]
    info = folder / "published-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: published\nVersion: 0.1\n")
    lines = [
        line
        for group, points in groups.items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in points.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
