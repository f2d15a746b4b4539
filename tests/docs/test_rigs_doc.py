"""docs/rigs.md: its rig from nothing runs, its unit is found, its bytes are those of the code."""

import json
import re
import textwrap
import tomllib
from pathlib import Path

from typer.testing import CliRunner

import hmpim.rigs.wire.datagram as datagram
import hmpim.rigs.wire.hello as hello
from hmpim.cli.main import app
from hmpim.formats import load
from hmpim.rigs.catalogue import KINDS, describe

DOC = (Path(__file__).parents[2] / "docs" / "rigs.md").read_text(encoding="utf-8")


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", DOC, re.DOTALL)


def test_a_rig_from_nothing_is_found_by_its_entry_point_and_identified(tmp_path, monkeypatch):
    """A shorter sweep than the page's, which is played in real time."""
    (tmp_path / "lever.py").write_text(blocks("python")[0], encoding="utf-8")
    (stated,) = [b for b in blocks("toml") if "entry-points" in b]
    points = tomllib.loads(stated)["project"]["entry-points"]["hmpim.rigs"]
    info = tmp_path / "lever-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lever\nVersion: 0.1\n")
    lines = [f"{name} = {value}" for name, value in points.items()]
    (info / "entry_points.txt").write_text("[hmpim.rigs]\n" + "\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    (script,) = [b for b in blocks("sh") if "--rig lever" in b]
    assert "--band 0.2 8 --duration 4" in script
    for line in script.replace("0.2 8 --duration 4", "1 8 --duration 1.5").splitlines():
        program, *arguments = line.split()
        assert program == "hmpim"
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
    (pair,) = json.loads((tmp_path / "lever.json").read_text())["pairs"]
    found = pair["parameters"]["time_constant"]
    assert abs(found["value"] - 0.03) < max(5 * found["std"], 1e-3)
    assert load(tmp_path / "lever.h5").samples > 250


def test_the_unit_on_the_table_is_found():
    space = {}
    exec(compile(blocks("python")[1], "docs/rigs.md", "exec"), space)
    parameters = space["seen"]["angle", "yaw.position"].parameters
    for name, truth in (("delay", 0.012), ("natural_frequency", 8.0), ("damping_ratio", 0.5)):
        assert abs(getattr(parameters, name).value - truth) < 0.01 * truth
    assert space["moved"]["yaw.position"].parameters.bandwidth_phase90 is not None


def test_the_bytes_are_those_of_the_code():
    texts = blocks("text")
    for text, doc in zip(texts, (datagram, datagram, hello), strict=True):
        assert textwrap.indent(text.rstrip(), "    ") in doc.__doc__


def test_the_description_is_one_and_every_kind_is_named():
    (described,) = [b for b in blocks("toml") if "[limits]" in b]
    assert describe(tomllib.loads(described)).watchdog == 0.08
    table = DOC.partition("## A run over a wire")[0]
    for kind in KINDS:
        assert f"`{kind.form}`" in table, kind.form
