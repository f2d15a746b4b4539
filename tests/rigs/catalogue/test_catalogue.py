"""Rigs by name, kind and address; what a file says wrongly is told in a line."""

from importlib.metadata import EntryPoint

import pytest

from hmpim.errors import FormatError, HmpimError, RigError
from hmpim.rigs import Rig, Sensor
from hmpim.rigs.catalogue import (
    config_files,
    describe,
    find_rig,
    kinds,
    named_rigs,
    offered_kinds,
    read_description,
)
from hmpim.stimulus import Limits


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder below one with an hmpim.toml, and a user's hmpim.toml elsewhere."""
    home = tmp_path / "home"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(home))
    monkeypatch.setattr("platformdirs.user_config_path", lambda *_a, **_k: home / "hmpim")
    (home / "hmpim").mkdir(parents=True)
    (home / "hmpim" / "hmpim.toml").write_text(
        '[rigs.bench]\nrig = "table"\n[rigs.mine]\nrig = "sensor"\noptions = {delay = 0.2}\n'
    )
    (tmp_path / "work" / "deep").mkdir(parents=True)
    (tmp_path / "work" / "hmpim.toml").write_text(
        '[rigs.bench]\nrig = "sensor"\nunit = "deg"\nlimits = {position = 5.0}\n'
        '[rigs.odd]\nrig = "sensor"\nspeed = 3\n[rigs.empty]\nunit = "deg"\n'
    )
    return tmp_path / "work" / "deep"


def test_the_projects_rigs_win_over_the_users(project):
    assert [path.parent.name for path in config_files(project)] == ["work", "hmpim"]
    named = named_rigs(project)
    assert set(named) == {"bench", "mine", "odd", "empty"}
    found = find_rig("bench", start=project)
    assert isinstance(found.rig, Sensor)
    assert found.limits == Limits(position=5.0, unit="deg")
    assert find_rig("mine", start=project).rig.delay == 0.2


def test_a_broken_description_harms_only_itself(project):
    words = r"hmpim.toml', \[rigs.odd\]: 'speed' is not known; known are axes, limits, load"
    with pytest.raises(FormatError, match=words):
        find_rig("odd", start=project)
    with pytest.raises(FormatError, match=r"\[rigs.empty\]: 'rig' is missing"):
        find_rig("empty", start=project)
    with pytest.raises(RigError, match=r"there is no rig 'bnch'; there are .*bench.*sensor"):
        find_rig("bnch", start=project)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"rate": 0}, "rate = 0: input should be greater than 0"),
        ({"rate": "fast"}, "rate = 'fast': input should be a valid number"),
        ({"limits": {"position": -1}}, "position = -1: input should be greater than 0"),
        ({"limits": {"roll": {"velocty": 1}}}, "'limits.roll.velocty' is not known; known are acc"),
        ({"axes": "roll"}, r"axes = 'roll': input should be a list \[...\]"),
        ({"axes": ["roll"], "limits": {"yaw": {"position": 1}}}, "limits of 'yaw', which is none"),
        ({"unlimited": True, "limits": {"position": 1}}, "unlimited = true and limits contradict"),
        ({"mode": "VP"}, "mode = 'VP': input should be 'P', 'PV' or 'PVA'"),
        ({"watchdog": -0.1}, "watchdog = -0.1: "),
        ({"unit": "degg"}, "unit 'degg' is not known"),
        ({"axes": ["roll", "roll"]}, "'roll' is there twice; give each its own name"),
        ({"axes": ["roll", ""]}, "one has no name; give each its own name"),
        ([], "the description: "),
    ],
)
def test_what_a_description_may_not_say(data, words):
    with pytest.raises(FormatError, match=words):
        describe(data)


def test_limits_of_all_axes_or_of_each_in_their_units():
    each = describe({"unit": "rad", "limits": {"a": {"position": 1}, "b": {"unit": "deg"}}})
    assert each.stated_limits() == {"a": Limits(position=1, unit="rad"), "b": Limits(unit="deg")}
    assert describe({"unlimited": True}).stated_limits() == Limits()
    assert describe({}).stated_limits() is None


def test_files_that_cannot_be_read(tmp_path):
    path = tmp_path / "rig.toml"
    for data, words in ((b"rig = ", "is not valid TOML"), (b"\xff\xfe", "cannot be read")):
        path.write_bytes(data)
        with pytest.raises(FormatError, match=words):
            read_description(path)
    (tmp_path / "hmpim.toml").write_text("rigs = 3\n")
    with pytest.raises(FormatError, match=r"'rigs' must hold tables; write \[rigs.NAME\]"):
        named_rigs(tmp_path)


def test_a_rig_file_and_a_name_may_not_contradict(tmp_path):
    described = describe({"rig": "sensor"})
    assert isinstance(find_rig("", description=described).rig, Rig)
    assert isinstance(find_rig("sensor", description=described).rig, Sensor)
    with pytest.raises(FormatError, match="describes 'sensor', but the command names 'table'"):
        find_rig("table", description=described)
    with pytest.raises(RigError, match="no rig is named; give --rig"):
        find_rig("", description=describe({}), start=tmp_path)


@pytest.mark.parametrize(
    ("rig", "data", "words"),
    [
        ("sensor", {"options": {"dealy": 0.1}}, "option 'dealy' is not known for a sensor"),
        ("sensor", {"options": {"delay": -1}}, "delay = -1 is out of range"),
        ("sensor", {"options": {"delay": "long"}}, "delay = 'long' is not a number"),
        ("sensor:7", {}, "sensor:7: a sensor takes no argument; write sensor"),
        ("table", {"load": "ton"}, "load 'ton' is not known"),
        ("table", {"options": {"mode": "PV"}}, "belongs outside the options, as 'mode'"),
        ("table", {"options": {"start": {"nod": 3}}}, "must be a table of angles"),
        ("table", {"options": {"start": {"yaw": "up"}}}, "holds no angles"),
        ("table", {"options": {"delay": "short"}}, "make no table"),
        ("table", {"axes": ["nod"]}, "axis 'nod' is none of the table's"),
        ("table", {"unlimited": True}, "the table has limits, those of Fig. 4"),
        (
            "sensor",
            {"load": "bracket"},
            "load = 'bracket' does not apply to a sensor; leave it out",
        ),
        ("tracker", {"mode": "PV"}, "mode = 'PV' does not apply to a tracker; leave it out"),
        ("process:cat", {"load": "bracket"}, "load = 'bracket' does not apply to a program"),
        ("udp://h:1", {"load": "bracket"}, "load = 'bracket' does not apply to a UDP rig"),
        ("serial:x", {"mode": "PV"}, "mode = 'PV' does not apply to a serial rig; leave it out"),
        ("can:x", {"load": "bracket"}, "load = 'bracket' does not apply to a CAN rig"),
        ("process:cat", {"options": {"name": 3}}, "name = 3 is not a text"),
        ("seeker", {"load": "ton"}, "load 'ton' is not known"),
        ("python:f.py:smooth:smple", {}, "ends in 'smple', which is not known; after the function"),
        ("seeker", {"options": {"name": 3}}, "name = 3 is not a text"),
    ],
)
def test_what_a_kind_does_not_take(rig, data, words):
    with pytest.raises(HmpimError, match=words):
        find_rig(rig, description=describe(data))


def test_the_table_takes_load_mode_start_and_limits():
    described = describe(
        {
            "rig": "table",
            "load": "bracket+projector",
            "mode": "PV",
            "unit": "deg",
            "limits": {"roll": {"velocity": 100.0}},
            "options": {"start": {"yaw": 20.0}, "friction": False},
        }
    )
    found = find_rig("", description=described)
    table = found.rig
    assert (table.uut_load, table.target_load, table.mode) == ("bracket", "projector", "PV")
    assert (table.start.yaw, table.friction) == (20.0, False)
    assert found.limits == {"roll": Limits(velocity=100.0, unit="deg")}


def test_the_seekers_table_takes_load_and_mode():
    described = describe({"load": "bracket", "mode": "PV", "options": {"table": {"delay": 0.002}}})
    table = find_rig("seeker", description=described).rig.table
    assert (table.uut_load, table.mode, table.delay) == ("bracket", "PV", 0.002)
    assert find_rig("seeker", description=describe({"load": "bracket"})).rig.table.mode == "PVA"


def test_kinds_of_other_packages_by_entry_point(monkeypatch, tmp_path):
    (tmp_path / "shakers.py").write_text(
        "from hmpim.rigs import Sensor\n"
        "def build(argument, description):\n    return Sensor(name=argument or 'shaker')\n"
        "nothing = 3\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    def point(name, value):
        return EntryPoint(name=name, value=value, group="hmpim.rigs")

    points = (
        point("shaker", "shakers:build"),
        point("gone", "no_such_module:build"),
        point("number", "shakers:nothing"),
        point("sensor", "shakers:build"),
    )

    def installed(*, group, name=None):
        assert group == "hmpim.rigs"
        return tuple(p for p in points if name in (None, p.name))

    monkeypatch.setattr(kinds, "entry_points", installed)
    faults = {offered.name: offered.fault for offered in offered_kinds()}
    assert faults["shaker"] == ""
    assert "No module named 'no_such_module'" in faults["gone"]
    assert "is 3, and no function" in faults["number"]
    assert "is a kind of hmpim itself" in faults["sensor"]
    assert find_rig("shaker://bay4", start=tmp_path).rig.name == "bay4"
    with pytest.raises(RigError, match=r"rig 'gone' of another package is broken: ModuleNotFound"):
        find_rig("gone", start=tmp_path)
    with pytest.raises(RigError, match=r"there is no rig 'x'; there are .*sensor.*shaker"):
        find_rig("x", start=tmp_path)
