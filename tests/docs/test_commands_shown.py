"""Every command that README and documents show is one: its options, scripts and targets exist."""

import re
import shlex
from functools import cache
from pathlib import Path

import pytest
from typer.main import get_command

from hmpim.cli.main import app

ROOT = Path(__file__).parents[2]
DOCUMENTS = sorted(path for path in (ROOT / "docs").rglob("*.md") if "build" not in path.parts)
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCUMENTS]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
OPTION = re.compile(r"-{1,2}[a-zA-Z]")


@cache
def root_command():
    return get_command(app)


def commands_of(page):
    """What begins a line of a block of commands, or stands in the text between backquotes."""
    text = page.read_text(encoding="utf-8")
    blocks = [code for kind, code in FENCED.findall(text) if kind in ("", "sh", "console")]
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    inline = re.findall(r"`([^`]+)`", FENCED.sub("", text))
    for line in [*lines, *(" ".join(code.split()) for code in inline)]:
        for command in re.split(r" && | # | > ", line.removeprefix("$ ")):
            yield command.strip()


def shown(page, *programs):
    for command in commands_of(page):
        words = command.replace("…", "").split()
        if len(words) > 1 and words[0].rpartition("/")[2] in programs:
            yield shlex.split(command.replace("…", ""))[1:]


def unknown_of(words):
    """Words that should be the name of a command or of one of its options, and are not."""
    command = root_command()
    while hasattr(command, "commands") and words and not words[0].startswith("-"):
        if words[0] not in command.commands:
            return [words[0]]
        command, words = command.commands[words[0]], words[1:]
    names = {name for each in command.params for name in (*each.opts, *each.secondary_opts)}
    given = [word.partition("=")[0] for word in words if OPTION.match(word)]
    return [name for name in given if name not in names | {"--help"}]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_scripts_and_targets_exist(page):
    wrong = [(words, unknown_of(words)) for words in shown(page, "hmpim") if unknown_of(words)]
    assert not wrong
    for words in shown(page, "python", "python3"):
        files = [word for word in words if re.match(r"(benchmarks|tests|examples)/", word)]
        assert [file for file in files if not (ROOT / file.partition("::")[0]).exists()] == []
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target, *_ in shown(page, "make"):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_pages_were_read():
    assert sum(1 for page in PAGES for _ in shown(page, "hmpim")) > 100
    assert sum(1 for page in PAGES for _ in shown(page, "python")) > 30
    assert unknown_of(["identify", "--no-such", "r.csv"]) == ["--no-such"]
    assert unknown_of(["identfy"]) == ["identfy"]
