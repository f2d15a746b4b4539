"""The project's own files agree: extras, constraints, what make can do."""

import re
import subprocess
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from itertools import chain
from pathlib import Path

from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
TARGETS = ("demo", "test", "install", "check", "studies", "accuracy", "bench", "docs")


def name_of(requirement):
    """Name of a required package as package indexes write it."""
    return re.match(r"[\w.-]+", requirement)[0].lower().replace("_", "-")


def test_the_extra_all_holds_every_other_one():
    (everything,) = EXTRAS["all"]
    named = re.fullmatch(r"hmpim\[([\w,-]+)\]", everything)[1].split(",")
    assert sorted(named) == sorted(set(EXTRAS) - {"all"})


def test_every_package_that_is_asked_for_is_pinned():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {name_of(line) for line in lines if "==" in line}
    groups = PROJECT["dependency-groups"].values()
    wanted = [*PROJECT["project"]["dependencies"], *chain(*EXTRAS.values(), *groups)]
    wanted = [line for line in wanted if isinstance(line, str)]  # groups include one another
    assert {name_of(line) for line in wanted} - {"hmpim"} <= pinned


def test_every_pinned_package_runs_on_the_oldest_python_that_is_promised():
    """The first release of it, as a distribution may stay with that: 3.11.2 in Debian 12."""
    oldest = PROJECT["project"]["requires-python"].removeprefix(">=") + ".0"
    newer = []
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines():
        try:
            found = distribution(name_of(line)) if "==" in line else None
        except PackageNotFoundError:
            continue
        pinned = line.partition("==")[2].partition(";")[0].strip()
        if found and found.version == pinned:
            asked = SpecifierSet(found.metadata.get("Requires-Python", ""))
            newer += [line] if oldest not in asked else []
    assert not newer


def test_make_knows_what_is_promised():
    for target in TARGETS:
        done = subprocess.run(
            ["make", "--dry-run", "--always-make", target],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        extras = re.search(r"-e '\.\[([\w,]+)\]'", done.stdout)[1]
        assert extras == ("table" if target == "demo" else "all"), target
