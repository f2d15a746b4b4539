"""Plans: what they hold, and what is refused by the name of its key."""

import copy
import tomllib
from pathlib import Path

import pytest

from hmpim.campaign import PLANS, expand, parse_plan, read_plan, shipped_plan
from hmpim.errors import ArgumentError, FormatError


def example():
    return tomllib.loads(shipped_plan("example").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", PLANS)
def test_every_shipped_plan_has_cases_of_different_names(name):
    cases = expand(read_plan(shipped_plan(name)))
    assert len({case.id for case in cases}) == len(cases) > 0


def test_section_v_is_every_combination():
    plan = read_plan(shipped_plan("section_v"))
    # 5 acceptance, 2 x 5 loaded, 2 x 2 outer, 2 x 5 in each of two modes, 6 levels, 1 together
    assert len(expand(plan)) == 5 + 10 + 4 + 20 + 6 + 1
    driven = {(c.axes, c.mode, c.rate) for c in expand(plan) if not c.together}
    for axis in ("roll", "yaw", "pitch", "azimuth", "elevation"):
        for mode in ("P", "PV", "PVA"):
            assert {((axis,), mode, 500.0), ((axis,), mode, 1000.0)} <= driven
    assert [case.axes for case in expand(plan) if case.together] == [
        ("roll", "yaw", "pitch", "azimuth", "elevation")
    ]


def test_digest_is_of_what_is_measured_alone():
    data = example()
    before = parse_plan(data).digest
    data["specification"][0]["min"] = 21.0
    data["name"] = "another"
    assert parse_plan(data).digest == before
    data["stimulus"]["duration"] = 6.0
    assert parse_plan(data).digest != before


def broken(**changes):
    data = copy.deepcopy(example())
    for path, value in changes.items():
        inner = data
        *way, last = path.split("__")
        for step in way:
            inner = inner[int(step) if step.isdigit() else step]
        if value is None:
            del inner[last]
        else:
            inner[last] = value
    return data


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": None}, "name is missing"),
        ({"name": None, "nmae": "n"}, "name is missing; give it in place of nmae"),
        ({"colour": 1}, "colour is not known"),
        ({"seed": -1}, "seed = -1 must be"),
        ({"rig__kind": "tabel"}, "rig.kind = 'tabel' must be one of table, sensor, python"),
        ({"stimulus__duration": float("nan")}, "stimulus.duration = nan must be a finite"),
        ({"stimulus__duration": True}, "stimulus.duration = True"),
        ({"axes__inner__band": [5.0]}, r"axes.inner.band = \[5.0\] must be two rising"),
        ({"axes__inner__band": [5.0, 1.0]}, "two rising"),
        ({"axes__inner__limits": None}, "axes.inner.limits is missing"),
        ({"axes__inner__limits__speed": 2.0}, "axes.inner.limits.speed is not known"),
        ({"axes__inner__sensor__delay": -1.0}, "axes.inner.sensor: delay"),
        ({"test__0__axes": ["middle"]}, r"test\[1\].axes holds 'middle'"),
        ({"test__0__levels": [1.5]}, r"test\[1\].levels = \[1.5\] go beyond 1"),
        ({"test__0__rates": []}, r"test\[1\].rates = \[\] must be a list"),
        ({"test__0__rates": [500.0, 500.0]}, "stands twice"),
        ({"test__0__name": "../up"}, r"test\[1\].name = '../up' may hold"),
        ({"test__0__travel": 0.0}, r"test\[1\].travel = 0.0 must be a finite number above 0"),
        ({"test__0__bands": {"middle": [1.0, 2.0]}}, r"test\[1\].bands.middle is not known"),
        ({"test__0__bands": {"inner": [2.0, 1.0]}}, r"test\[1\].bands.inner = .* two rising"),
        ({"test__0__together": True}, "together needs a rig with several axes"),
        ({"test__0__modes": ["PV"]}, "modes and loads belong to a table"),
        ({"specification__0__quantity": "speed"}, r"specification\[1\].quantity = 'speed'"),
        ({"specification__0__min": None}, r"specification\[1\].min .* limit nothing"),
        (
            {"specification__0__min": None, "specification__0__mim": 1.0},
            r"specification\[1\].mim is not known; use .*min",
        ),
        ({"figure__0__tests": ["none"]}, r"figure\[1\].tests holds 'none'"),
        ({"figure__0__compare": "colours"}, r"figure\[1\].compare = 'colours'"),
    ],
)
def test_refused_by_its_key(changes, message):
    with pytest.raises(ArgumentError, match=message):
        parse_plan(broken(**changes))


def test_no_toml_is_refused(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_bytes(b"\xff\x00 = [")
    with pytest.raises(FormatError, match="is not a TOML plan"):
        read_plan(path)


@pytest.mark.parametrize("name", PLANS)
def test_examples_are_the_plans_that_ship(name):
    example = Path(__file__).parents[2] / "examples" / "plans" / f"{name}.toml"
    assert example.read_bytes() == shipped_plan(name).read_bytes()
