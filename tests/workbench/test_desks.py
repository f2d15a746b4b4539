"""Desks: kept as they were, apart from each other, and never in the way when damaged."""

import json
from dataclasses import replace

import pytest

from hmpim.workbench.desks import Analysis, AxisRow, Checked, Desk, Desks, Wish

FULL = Desk(
    name="0123456789ab",
    wish=Wish(rows=(AxisRow(name="roll"), AxisRow(name="pitch", low=0.5)), extinction=0.8),
    rig="bench",
    checked=Checked(rig="bench", digest="x", green=("limits", "answer")),
    analysis=Analysis(
        file="a.csv", inputs=("u",), outputs=("y", "<z>"), start=1.0, hand={"delay": 0.12}
    ),
    chosen_runs=("a.h5", "b.h5"),
    dark=True,
)


def test_a_desk_is_read_back_as_it_was(tmp_path):
    Desks(tmp_path).put(FULL)
    assert Desks(tmp_path).get(FULL.name) == FULL


def test_desks_do_not_disturb_each_other(tmp_path):
    desks = Desks(tmp_path)
    one, two = desks.fresh(), desks.fresh()
    desks.put(replace(one, rig="bench"))
    assert desks.get(two.name).rig == ""
    assert desks.latest(without={one.name}).name == two.name
    assert desks.latest(without={one.name, two.name}).name not in (one.name, two.name)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"name": 3}', '{"name": "0123456789ab", "wish": 1}']
)
def test_a_damaged_desk_is_as_good_as_none(tmp_path, text):
    (tmp_path / "0123456789ab.json").write_text(text)
    assert Desks(tmp_path).get("0123456789ab") is None
    assert Desks(tmp_path).latest(without=set()).name != "0123456789ab"


def test_a_desk_of_another_version_keeps_what_both_know(tmp_path):
    Desks(tmp_path).put(FULL)
    file = tmp_path / f"{FULL.name}.json"
    data = json.loads(file.read_text())
    data["novel"] = 1
    del data["analysis"]
    file.write_text(json.dumps(data))
    assert Desks(tmp_path).get(FULL.name) == replace(FULL, analysis=Analysis())


@pytest.mark.parametrize("name", ["../secret", "", "a/b", "0123456789AB", "x" * 99])
def test_a_name_from_an_address_leads_nowhere_else(tmp_path, name):
    (tmp_path.parent / "secret.json").write_text("{}")
    assert Desks(tmp_path).get(name) is None
