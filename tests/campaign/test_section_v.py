"""Section V: what the paper saw, on the simulated table."""

from dataclasses import replace

import pytest

from hmpim.campaign import expand, read_plan, run_campaign, shipped_plan
from hmpim.campaign.cases import prepare
from hmpim.campaign.compare import linear_from, samples_reading
from hmpim.campaign.rig import make_rig
from hmpim.campaign.study import make_study
from hmpim.identify.section_iv.spectrum import decibel, spectrum

pytest.importorskip("mujoco", reason="the table needs the extra 'table'")


def check(study):
    def row(test, axis, rate=1000.0, together=False):
        (found,) = [
            r
            for r in study.rows
            if (r.test, r.axis, r.rate, r.together) == (test, axis, rate, together)
        ]
        return found

    def bandwidth(*which, **more):
        return row(*which, **more).parameters["bandwidth_phase90"].value

    assert study.met is True
    # Figs 19 and 20: the rate of the commands hardly matters
    slow, fast = bandwidth("loaded", "azimuth", 500.0), bandwidth("loaded", "azimuth", 1000.0)
    assert slow == pytest.approx(fast, rel=0.01)
    # heavier load, lower bandwidth: between the first and the half power of torque over inertia
    free = row("acceptance", "azimuth")
    ratio = free.inertia / row("loaded", "azimuth").inertia
    assert ratio < fast / bandwidth("acceptance", "azimuth") < ratio**0.4
    check_levels(study)
    # Figs 24 and 25: all at once says the same
    joint = bandwidth("together", "roll", together=True)
    assert joint == pytest.approx(bandwidth("loaded", "roll"), rel=0.03)
    seen = {(c["from"], c["to"]): c["gain"] for c in study.couplings}
    moved = [r.axis for r in study.rows if r.together]
    assert len(seen) == len(moved) * (len(moved) - 1)
    assert max(seen.values()) < 0.02


def check_levels(study):
    """Fig. 22: friction lowers the bandwidth of small motions."""
    levels = sorted((r for r in study.rows if r.test == "levels"), key=lambda r: r.peaks[2])
    read = [samples_reading(r).value for r in levels]
    assert read == sorted(read)
    assert read[0] < 0.9 * read[-1]
    assert levels[0].peaks[2] < linear_from(levels).peaks[2] < levels[-1].peaks[2]


def check_feedforward(study):
    """Feedforward raises the bandwidth, each command by half as much again at least."""
    fed = {
        r.mode: samples_reading(r).value
        for r in study.rows
        if r.axis == "pitch"
        and r.rate == 1000.0
        and r.test in ("loaded", "velocity", "acceleration")
    }
    assert 1.5 * fed["P"] < fed["PV"] < fed["PVA"] / 1.5


@pytest.mark.parametrize("rate", [500.0, 1000.0])
def test_stimuli_of_fig_18_are_above_30_db_up_to_10_hz(rate):
    plan = read_plan(shipped_plan("section_v"))
    rig = make_rig(plan)
    cases = [c for c in expand(plan) if c.test == "outer" and c.rate == rate]
    assert len(cases) == 2
    for case in cases:
        (stimulus,) = prepare(plan, case, rig)
        bins = spectrum(stimulus.position, stimulus.fs, window="gaussian", alpha=1.5)
        band = (bins.frequency >= 0.2) & (bins.frequency <= 10.0)
        level = decibel(bins.value[band])
        assert level.min() > (30.0 if rate == 500.0 else 36.0)
        assert stimulus.extinction > 1.5  # the paper's "severe extinction"


def half_as_long(*names):
    """These tests of the reduced plan, in 5 s."""
    plan = read_plan(shipped_plan("section_v_reduced"))
    return replace(
        plan,
        duration=5.0,
        axes=tuple(replace(axis, travel=2.0) for axis in plan.axes),
        tests=tuple(test for test in plan.tests if test.name in names),
        figures=tuple(f for f in plan.figures if set(f.tests) <= set(names)),
        specifications=tuple(s for s in plan.specifications if s.test in names),
    )


@pytest.mark.study  # small: tests/rigs/table/test_table.py, of the same name
def test_friction_lowers_the_bandwidth_of_small_motions(tmp_path):
    plan = half_as_long("levels")
    check_levels(make_study(plan, run_campaign(plan, tmp_path)))


@pytest.mark.study
def test_half_as_long(tmp_path):
    """Without what takes longest: feedforward, and the outer sweeps."""
    plan = half_as_long("acceptance", "loaded", "levels", "together")
    check(make_study(plan, run_campaign(plan, tmp_path)))


@pytest.mark.study
@pytest.mark.parametrize("name", ["section_v_reduced", "section_v"])
def test_as_shipped(name, tmp_path):
    plan = read_plan(shipped_plan(name))
    study = make_study(plan, run_campaign(plan, tmp_path))
    check(study)
    check_feedforward(study)
