"""docs/rigs.md: its rig from nothing runs, its unit is found, its bytes are those of the code."""

import json
import os
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path

import hmpim.rigs.wire.datagram as datagram
import hmpim.rigs.wire.hello as hello
from hmpim.formats import load
from hmpim.rigs.catalogue import KINDS, describe

DOC = (Path(__file__).parents[2] / "docs" / "rigs.md").read_text(encoding="utf-8")


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", DOC, re.DOTALL)


def test_a_rig_from_nothing_is_found_by_its_entry_point_and_identified(tmp_path):
    (tmp_path / "lever.py").write_text(blocks("python")[0], encoding="utf-8")
    (stated,) = [b for b in blocks("toml") if "entry-points" in b]
    points = tomllib.loads(stated)["project"]["entry-points"]["hmpim.rigs"]
    info = tmp_path / "lever-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lever\nVersion: 0.1\n")
    lines = [f"{name} = {value}" for name, value in points.items()]
    (info / "entry_points.txt").write_text("[hmpim.rigs]\n" + "\n".join(lines) + "\n")
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    (script,) = [b for b in blocks("sh") if "--rig lever" in b]
    for line in script.splitlines():
        program, *arguments = line.split()
        assert program == "hmpim"
        done = subprocess.run(
            [sys.executable, "-m", "hmpim.cli.main", *arguments],
            cwd=tmp_path, env=os.environ | {"PYTHONPATH": paths},
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    (pair,) = json.loads((tmp_path / "lever.json").read_text())["pairs"]
    found = pair["parameters"]["time_constant"]
    assert abs(found["value"] - 0.03) < max(5 * found["std"], 1e-3)
    assert load(tmp_path / "lever.h5").samples > 750


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
