"""docs/rigs.md: its rig from nothing runs, its unit is found, its bytes are those of the code."""

import json
import textwrap
import tomllib

import hmpim.rigs.wire.datagram as datagram
import hmpim.rigs.wire.hello as hello
from docs_following import execute, lines_of, page_of, published, snippet
from hmpim.formats import load
from hmpim.rigs.catalogue import KINDS, describe


def test_a_rig_from_nothing_is_found_by_its_entry_point_and_identified(tmp_path, monkeypatch):
    """A shorter sweep than the page's, which is played in real time."""
    (tmp_path / "lever.py").write_text(snippet("rigs.md", "import time"), encoding="utf-8")
    published(tmp_path, snippet("rigs.md", '[project.entry-points."hmpim.rigs"]'))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    script = snippet("rigs.md", "hmpim design --band 0.2 8")
    assert "--band 0.2 8 --duration 4" in script
    for line in lines_of(script.replace("0.2 8 --duration 4", "1 8 --duration 1.5")):
        execute(line)
    (pair,) = json.loads((tmp_path / "lever.json").read_text())["pairs"]
    found = pair["parameters"]["time_constant"]
    assert abs(found["value"] - 0.03) < max(5 * found["std"], 1e-3)
    assert load(tmp_path / "lever.h5").samples > 250


def test_the_unit_on_the_table_is_found():
    space = {}
    exec(compile(snippet("rigs.md", "from hmpim import design"), "docs/rigs.md", "exec"), space)
    parameters = space["seen"]["angle", "yaw.position"].parameters
    for name, truth in (("delay", 0.012), ("natural_frequency", 8.0), ("damping_ratio", 0.5)):
        assert abs(getattr(parameters, name).value - truth) < 0.01 * truth
    assert space["moved"]["yaw.position"].parameters.bandwidth_phase90 is not None


def test_the_bytes_are_those_of_the_code():
    texts = (
        snippet("rigs.md", "offset"),
        snippet("rigs.md", "COMMAND"),
        snippet("rigs.md", '{"protocol"'),
    )
    for text, doc in zip(texts, (datagram, datagram, hello), strict=True):
        assert textwrap.indent(text.rstrip(), "    ") in doc.__doc__


def test_the_description_is_one_and_every_kind_is_named():
    described = snippet("rigs.md", 'rig = "udp://')
    assert describe(tomllib.loads(described)).watchdog == 0.08
    table = page_of("rigs.md").read_text(encoding="utf-8").partition("## A run over a wire")[0]
    for kind in KINDS:
        assert f"`{kind.form}`" in table, kind.form
