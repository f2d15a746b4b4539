"""Campaigns: cases run once, stopped and resumed, refused before anything moves."""

import json
import re
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import hmpim
from hmpim.campaign import expand, parse_plan, read_plan, run_campaign, shipped_plan
from hmpim.campaign.cases import prepare
from hmpim.campaign.grids import change_grid
from hmpim.campaign.rig import make_rig
from hmpim.campaign.study import make_study, study_dict
from hmpim.campaign.write import headline, write_study
from hmpim.errors import ArgumentError, FormatError, HmpimError, LimitsError
from hmpim.experiment import run
from hmpim.formats.recording import read_recording
from hmpim.rigs import Sensor


def plan_of(**changes):
    data = tomllib.loads(shipped_plan("example").read_text(encoding="utf-8"))
    data["stimulus"]["duration"] = 3.0
    data["test"][0]["rates"] = [250.0]
    data.update(changes)
    return parse_plan(data)


class Stopping:
    """A rig that counts its runs and is stopped from the keyboard at one of them."""

    def __init__(self, stop_at=None):
        self.played = []
        self.stop_at = stop_at

    def __call__(self, case, stimuli, rng):
        if len(self.played) == self.stop_at:
            raise KeyboardInterrupt
        self.played.append(case.id)
        (stimulus,) = stimuli
        sensor = Sensor(
            delay=0.003,
            natural_frequency=20.0,
            damping_ratio=0.7,
            noise_std=0.01,
            input_name=f"{stimulus.axis}.command",
            output_name=f"{stimulus.axis}.position",
        )
        return run(sensor, stimulus, rng=rng)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    plan = plan_of()
    return plan, folder, run_campaign(plan, folder)


def test_truth_is_found(finished):
    plan, _, cases = finished
    study = make_study(plan, cases)
    assert len(study.rows) == 2
    for row in study.rows:
        sensor = plan.axis(row.axis).sensor
        for name in ("delay", "natural_frequency", "damping_ratio"):
            reading = row.parameters[name]
            assert abs(reading.value - getattr(sensor, name)) < 4.0 * reading.std
    assert study.met is True


def test_the_raw_record_of_every_case_is_kept_and_can_be_identified_again(finished):
    _, folder, cases = finished
    assert {path.stem for path in (folder / "records").iterdir()} == {c["id"] for c in cases}
    for case in cases:
        path = folder / "records" / f"{case['id']}.h5"
        again = hmpim.identify(hmpim.load(path)).to_dict()["pairs"][0]
        (pair,) = case["pairs"]
        for name in ("parameters", "structure", "verdict", "dynamics"):
            assert again[name] == pair[name], name
        (played,) = read_recording(path).stimuli
        assert played.axis == pair["axis"]


def test_a_case_that_cannot_be_identified_leaves_its_record(tmp_path):
    def dead(case, stimuli, rng):
        record = Stopping()(case, stimuli, rng)
        (output,) = record.outputs
        return replace(record, outputs=(replace(output, values=0.0 * output.values),))

    plan = plan_of()
    with pytest.raises(HmpimError, match="is constant"):
        run_campaign(plan, tmp_path, player=dead)
    (kept,) = (tmp_path / "records").iterdir()
    assert np.ptp(hmpim.load(kept).outputs[0].values) == 0.0
    assert list((tmp_path / "cases").iterdir()) == []
    run_campaign(plan, tmp_path, player=Stopping())
    assert np.ptp(hmpim.load(kept).outputs[0].values) > 0.0


def test_interrupted_goes_on_and_repeats_nothing(tmp_path):
    plan = plan_of()
    ids = [case.id for case in expand(plan)]
    first = Stopping(stop_at=1)
    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan, tmp_path, player=first)
    second = Stopping()
    run_campaign(plan, tmp_path, player=second)
    assert first.played == ids[:1]
    assert second.played == ids[1:]
    third = Stopping()
    whole = run_campaign(plan, tmp_path, player=third)
    assert third.played == []
    # Stopped or not, the same seed gives the same study.
    assert whole == run_campaign(plan, tmp_path / "again", player=Stopping())


def test_a_campaign_of_an_earlier_schema_is_not_resumed(finished, tmp_path):
    """It says to start afresh, before anything moves; afresh it runs."""
    plan, _, _ = finished
    rig = Stopping()
    run_campaign(plan, tmp_path, player=rig)
    stamp = tmp_path / "campaign.json"
    old = json.loads(stamp.read_text(encoding="utf-8")) | {"schema": "hmpim/campaign/1"}
    stamp.write_text(json.dumps(old), encoding="utf-8")
    with pytest.raises(FormatError, match=r"hmpim/campaign/1.* start afresh with --fresh"):
        run_campaign(plan, tmp_path, player=rig)
    before = len(rig.played)
    run_campaign(plan, tmp_path, fresh=True, player=rig)
    assert len(rig.played) == 2 * before


def test_changed_plan_says_so_and_fresh_starts_anew(finished, tmp_path):
    plan = plan_of()
    rig = Stopping()
    run_campaign(plan, tmp_path, player=rig)
    changed = plan_of(seed=8)
    with pytest.raises(ArgumentError, match="the plan was changed since"):
        run_campaign(changed, tmp_path, player=rig)
    assert len(rig.played) == 2
    run_campaign(changed, tmp_path, fresh=True, player=rig)
    assert len(rig.played) == 4


def test_refused_before_anything_moves(tmp_path):
    data = tomllib.loads(shipped_plan("example").read_text(encoding="utf-8"))
    data["axes"]["outer"]["limits"]["velocity"] = 0.5  # the second axis cannot
    rig = Stopping()
    with pytest.raises(LimitsError, match=r"case rates\.acceptance\.P\.250Hz\.0\.5\.outer: "):
        run_campaign(parse_plan(data), tmp_path, player=rig)
    assert rig.played == []


def test_what_cannot_be_identified_is_said_with_its_case_and_the_rest_is_kept(tmp_path):
    plan = plan_of()
    ids = [case.id for case in expand(plan)]
    sound = Stopping()

    def play(case, stimuli, rng):
        record = sound(case, stimuli, rng)
        if case.id == ids[0]:
            return record
        (output,) = record.outputs
        return replace(record, outputs=(replace(output, values=0.0 * output.values),))

    with pytest.raises(HmpimError, match=rf"case {re.escape(ids[1])}: output .* is constant"):
        run_campaign(plan, tmp_path, player=play)
    assert [path.stem for path in (tmp_path / "cases").iterdir()] == ids[:1]


def test_damaged_case_is_named(finished, tmp_path):
    plan = plan_of()
    run_campaign(plan, tmp_path, player=Stopping())
    path = next((tmp_path / "cases").glob("*.json"))
    path.write_text("{", encoding="utf-8")
    with pytest.raises(FormatError, match="is damaged"):
        run_campaign(plan, tmp_path)


def test_progress_never_goes_back(tmp_path):
    told = []
    run_campaign(plan_of(), tmp_path, player=Stopping(), progress=lambda *t: told.append(t))
    done = [t[0] for t in told]
    assert done == sorted(done)
    assert told[-1][0] == told[-1][1] == 12
    # A design is quick, a test is not: the time left is told from what they take.
    assert [t[0] for t in told] == [0, 1, 2, 7, 12]


def test_specification_not_met_and_without_figure(finished):
    plan, _, cases = finished
    (first, *_) = plan.specifications
    tight = replace(first, low=1000.0)
    absent = replace(first, quantity="hold_period")
    study = make_study(replace(plan, specifications=(first, tight, absent)), cases)
    assert [check.outcome for check in study.checks] == ["pass", "fail", "fail"]
    assert study.met is False
    nobody = replace(first, load="ton")
    with pytest.raises(FormatError, match="fits no case"):
        make_study(replace(plan, specifications=(nobody,)), cases)


def test_a_specification_that_fits_no_case_is_refused_before_anything_moves(tmp_path):
    plan = plan_of()
    nobody = replace(plan.specifications[0], rate=123.0)
    rig = Stopping()
    with pytest.raises(ArgumentError, match=r"specification\[2\] fits no case"):
        run_campaign(
            replace(plan, specifications=(plan.specifications[0], nobody)), tmp_path, player=rig
        )
    assert rig.played == []


def test_comparison_finds_what_moved_and_only_that(finished, tmp_path):
    plan, _, cases = finished
    write_study(make_study(plan, cases), tmp_path)
    earlier = tmp_path / "study.json"
    same = make_study(plan, cases, earlier=earlier)
    assert same.changes
    assert not any(change.differs for change in same.changes)
    moved = [dict(case) for case in cases]
    pair = dict(moved[0]["pairs"][0])
    delay = pair["parameters"]["delay"]
    shifted = {**delay, "value": delay["value"] + 10.0 * delay["std"]}
    pair["parameters"] = {**pair["parameters"], "delay": shifted}
    # A step of the encoder, known to rounding: its last digits are no change.
    step = {"value": 0.003, "std": 1e-19, "ci95": [0.003, 0.003], "unit": "deg", "verdict": "ok"}
    pair["parameters"]["quantization_step"] = step
    moved[0]["pairs"] = [pair]
    (tmp_path / "stepped").mkdir()
    write_study(make_study(plan, moved), tmp_path / "stepped")
    pair["parameters"] = {
        **pair["parameters"],
        "quantization_step": {**step, "value": 0.003 * (1.0 + 1e-15)},
    }
    stepped = make_study(plan, moved, earlier=tmp_path / "stepped" / "study.json")
    assert "quantization_step" in [change.quantity for change in stepped.changes]
    assert not any(change.differs for change in stepped.changes)
    other = make_study(plan, moved, earlier=earlier)
    assert [(c.axis, c.quantity) for c in other.changes if c.differs] == [("inner", "delay")]
    # On a phone the two figures stand beside their names, and the long name of the case after them.
    assert change_grid(other).columns == ("Axis", "Quantity", "Before", "Now", "Case")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("bandwidth_phase90", "1 of them rests on a doubtful figure. 1 of 1 rows have doubtful"),
        ("bias", "No check rests on a doubtful figure. 1 of 1 rows have other doubtful"),
    ],
)
def test_the_headline_says_whether_a_check_rests_on_a_doubtful_figure(finished, name, said):
    plan, _, cases = finished
    study = make_study(plan, cases)
    (check,) = [c for c in study.checks if c.wanted.quantity == "bandwidth_phase90"][:1]
    parameters = {
        key: replace(value, verdict="doubtful" if key == name else "ok")
        for key, value in check.row.parameters.items()
    }
    row = replace(check.row, verdict="doubtful", parameters=parameters)
    doubted = replace(check, row=row, reading=parameters["bandwidth_phase90"])
    assert said in headline(replace(study, rows=(row,), checks=(doubted,)))


def test_page_needs_nothing_from_outside(finished, tmp_path):
    plan, _, cases = finished
    hostile = replace(plan, name="<script>alert(1)</script>")
    study = make_study(hostile, cases)
    write_study(study, tmp_path)
    page = (tmp_path / "study.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "http" not in page
    rows = (tmp_path / "study.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + len(study.rows)
    column = rows[0].split(",").index("bandwidth_phase90")
    found = [float(row.split(",")[column]) for row in rows[1:]]
    assert found == [row.parameters["bandwidth_phase90"].value for row in study.rows]
    lines = (tmp_path / "study.md").read_text(encoding="utf-8").splitlines()
    shown = [line.rpartition("(")[2].rstrip(")") for line in lines if line.startswith("![")]
    assert shown
    assert all((tmp_path / name).is_file() for name in shown)


def test_study_survives_json(finished):
    import json

    plan, _, cases = finished
    data = study_dict(make_study(plan, cases))
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert np.isfinite(data["rows"][0]["parameters"]["delay"]["std"])


def table_plan(*, level, seconds=3.0):
    """All five axes of the table at once, what they carry heavier than at acceptance."""
    axes = {
        "roll": {"band": [0.5, 60.0], "travel": 1.0},
        "yaw": {"band": [0.5, 40.0], "travel": 1.0},
        "pitch": {"band": [0.5, 30.0], "travel": 1.0},
        "azimuth": {"band": [0.5, 15.0], "travel": 1.0},
        "elevation": {"band": [0.5, 15.0], "travel": 1.0},
    }
    test = {"name": "all", "together": True, "levels": [level], "loads": ["bracket+projector"]}
    rig = {"kind": "table"}
    stimulus = {"duration": seconds}
    return parse_plan(
        {"name": "near", "rig": rig, "stimulus": stimulus, "axes": axes, "test": [test]}
    )


def test_load_of_all_axes_together_is_predicted_and_refused(tmp_path, monkeypatch):
    """Each axis keeps Fig. 4's limits; the torque they take together does not."""
    pytest.importorskip("mujoco")
    from hmpim.rigs.table import MotionTable

    def move(*_args, **_kwargs):
        pytest.fail("the table moved")

    monkeypatch.setattr(MotionTable, "play", move)
    words = r"case all\..*together: at \d\.\d+ s the motion of all axes .* N·m of azimuth, beyond"
    with pytest.raises(LimitsError, match=words):
        run_campaign(table_plan(level=0.99), tmp_path)


@pytest.mark.parametrize(("levels", "wanted"), [((0.5,), {"modelled"}), ((0.2, 0.5), {"reported"})])
def test_friction_is_modelled_unless_levels_are_compared(tmp_path, monkeypatch, levels, wanted):
    import hmpim.campaign.run as module

    asked = []

    def noted(record, *, nonlinear):
        asked.append(nonlinear)
        # What is asked for is looked at, so a quick answer will do.
        return hmpim.identify(record, structures=["second_order"], nonlinear="reported")

    monkeypatch.setattr(module, "identify", noted)
    pytest.importorskip("mujoco")
    plan = table_plan(level=0.5, seconds=1.0)
    test = replace(
        plan.tests[0],
        axes=("roll",),
        rates=(500.0,),
        loads=("acceptance",),
        levels=levels,
        together=False,
    )
    run_campaign(replace(plan, tests=(test,)), tmp_path)
    assert set(asked) == wanted
    assert len(asked) == len(levels)


def test_all_axes_at_once_are_identified_as_their_record_is(tmp_path, monkeypatch):
    """One answer to one question: the campaign's, and that of the record it has kept."""
    pytest.importorskip("mujoco")
    identify = partial(hmpim.identify, structures=["third_order"])
    monkeypatch.setattr("hmpim.campaign.run.identify", identify)
    plan = table_plan(level=0.5, seconds=2.0)
    both = replace(plan.tests[0], axes=("roll", "yaw"), rates=(250.0,), loads=("acceptance",))
    (case,) = run_campaign(replace(plan, tests=(both,)), tmp_path)
    found = identify(hmpim.load(tmp_path / "records" / f"{case['id']}.h5"))
    assert [pair["axis"] for pair in case["pairs"]] == ["roll", "yaw"]
    for pair in case["pairs"]:
        again = found[pair["output"], pair["input"]].to_dict()
        assert {name: pair[name] for name in again} == json.loads(json.dumps(again))
    assert [(c["from"], c["to"]) for c in case["couplings"]] == [("roll", "yaw"), ("yaw", "roll")]
    for coupling in case["couplings"]:
        names = f"{coupling['to']}.position", f"{coupling['from']}.command"
        response, (low, high) = found[names].frequency_response, coupling["band"]
        seen = (response.frequency >= low) & (response.frequency <= high)
        assert coupling["gain"] == np.median(np.abs(response.response[seen]))
        assert coupling["std"] < 0.1


def test_a_rate_the_table_cannot_take_is_refused_before_the_first_case_moves(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    from hmpim.rigs.table import MotionTable

    monkeypatch.setattr(MotionTable, "play", lambda *_, **__: pytest.fail("the table moved"))
    plan = table_plan(level=0.5)
    tests = (replace(plan.tests[0], axes=("roll",), rates=(1000.0, 700.0)),)
    with pytest.raises(ArgumentError, match=r"case all\..*700Hz.*: fs = 700 Hz does not divide"):
        run_campaign(replace(plan, tests=tests), tmp_path)


def test_more_travel_than_an_axis_has_is_refused_not_cut():
    plan = plan_of()
    case = expand(plan)[0]
    wide = tuple(replace(axis, travel=1.01 * axis.limits.position) for axis in plan.axes)
    plan = replace(plan, axes=wide)
    with pytest.raises(LimitsError, match=r"case .*inner: travel = .* deg is more than the .* has"):
        prepare(plan, case, make_rig(plan))


def test_a_test_may_have_bands_and_travel_of_its_own():
    data = tomllib.loads(shipped_plan("example").read_text(encoding="utf-8"))
    data["test"][0] |= {"bands": {"inner": [1.0, 20.0]}, "travel": 2.0}
    data["axes"]["inner"]["travel"] = 1.0  # less than what the test has of its own
    plan = parse_plan(data)
    assert plan.axis("inner", test="rates").band == (1.0, 20.0)
    assert plan.axis("inner", test="rates").travel == 2.0
    assert plan.axis("outer", test="rates").band == plan.axis("outer").band
    assert plan.axis("inner").band == (0.1, 60.0)
    case = expand(plan)[0]
    (stimulus,) = prepare(plan, case, make_rig(plan))
    assert stimulus.band == (1.0, 20.0)
    assert 1.9 < stimulus.peaks.position <= 2.0


@pytest.mark.parametrize("quantity", ["position", "velocity", "acceleration", "jerk"])
def test_limits_of_a_rig_of_ones_own_are_checked_right_before_it_moves(quantity):
    """Whatever made the stimulus: `check` looks at what is about to be played."""
    plan = plan_of()
    case = expand(plan)[0]
    rig = make_rig(plan, player=Stopping())
    (stimulus,) = prepare(plan, case, rig)
    own = plan.axis("inner").limits
    tight = replace(own, **{quantity: 0.9 * getattr(stimulus.peaks, quantity)})
    axes = tuple(replace(axis, limits=tight) for axis in plan.axes)
    stricter = make_rig(replace(plan, axes=axes), player=Stopping())
    with pytest.raises(LimitsError, match=f"peak {quantity} .* of 'inner'; scale"):
        stricter.check(case, (stimulus,))


def written(out):
    """Cases that are whole; what is being written has a hidden name."""
    return [path for path in out.glob("cases/*.json") if not path.name.startswith(".")]


def test_killed_outright_it_goes_on_and_repeats_nothing(tmp_path):
    """kill -9 leaves no time to tidy up: what is written by then counts, and nothing else."""
    plan = tmp_path / "plan.toml"
    text = shipped_plan("example").read_text(encoding="utf-8")
    for long, short in (
        ("duration = 5.0", "duration = 2.0"),
        ('axes = ["inner", "outer"]', 'axes = ["outer"]'),
        ("[250.0, 500.0]", "[125.0, 200.0, 250.0]"),
        ('axis = "inner" ', 'axis = "outer" '),
        ("min = 20.0", "min = 5.0"),
    ):
        assert long in text
        text = text.replace(long, short)
    plan.write_text(text, encoding="utf-8")
    out = tmp_path / "out"
    command = [sys.executable, "-m", "hmpim.cli.main", "campaign", str(plan), "--out", str(out)]
    with subprocess.Popen([*command, "--quiet"]) as running:
        deadline = time.monotonic() + 600.0
        while not written(out) and time.monotonic() < deadline:
            time.sleep(0.002)
        running.kill()
    assert running.returncode == -signal.SIGKILL
    done = {path: path.stat().st_mtime_ns for path in written(out)}
    assert 0 < len(done) < 3
    assert not (out / "study.json").exists()
    finished = run_campaign(read_plan(plan), out)
    cases = {path: path.stat().st_mtime_ns for path in written(out)}
    assert len(cases) == 3
    assert {path: cases[path] for path in done} == done
    assert sorted(out.glob("cases/*")) == sorted(cases)  # nothing half written is left
    # Killed or not, the same seed gives the same study: the last case again, alone.
    name = expand(read_plan(plan))[-1].id
    for path in (out / "cases" / f"{name}.json", out / "records" / f"{name}.h5"):
        path.unlink()
    assert run_campaign(read_plan(plan), out) == finished


def test_two_plans_of_one_process_may_name_their_rigs_alike(tmp_path):
    """Each gets the module beside it and what that imports; a library's name is only lent."""
    data = shipped_plan("example").read_text(encoding="utf-8")
    assert 'kind = "sensor"' in data
    data = data.replace('kind = "sensor"', 'kind = "python"\nentry = "bench:play"')
    data = re.sub(r"^sensor = .*$", "", data, flags=re.MULTILINE)
    said = []
    for place in ("one", "two", "one"):
        folder = tmp_path / place
        folder.mkdir(exist_ok=True)
        (folder / "plan.toml").write_text(data, encoding="utf-8")
        (folder / "tomllib.py").write_text(f"name = {place!r}\n")  # as one of Python's own
        (folder / "bench.py").write_text("import tomllib\ndef play(*_):\n    return tomllib.name\n")
        rig = make_rig(read_plan(folder / "plan.toml"))
        said.append(rig.player(None, (), None))
    assert said == ["one", "two", "one"]
    assert sys.modules["tomllib"] is tomllib
    assert str(tmp_path / "two") not in sys.path
