"""All five axes of the motion table in one record, held against each axis by itself."""

import numpy as np
import pytest

import hmpim
from hmpim.campaign.cases import expand, prepare
from hmpim.campaign.plan import read_plan
from hmpim.campaign.rig import make_rig
from hmpim.campaign.shipped import shipped_plan
from hmpim.rigs.table import MotionTable, linear_response

AXES = ("roll", "yaw", "pitch", "azimuth", "elevation")


@pytest.fixture(scope="module")
def stimuli():
    pytest.importorskip("mujoco")
    plan = read_plan(shipped_plan("demo"))
    case = next(case for case in expand(plan) if case.together and case.mode == "P")
    return {s.axis: s for s in prepare(plan, case, make_rig(plan))}


def together(stimuli, *, friction):
    table = MotionTable(friction=friction)
    record = hmpim.run(table, stimuli, rng=5)
    return table, record, hmpim.identify(record)


@pytest.mark.study  # small: tests/campaign/test_compare.py
def test_bandwidths_are_those_of_each_axis_alone(stimuli):
    _, record, found = together(stimuli, friction=True)
    for axis in AXES:
        alone = hmpim.Record(
            inputs=(record.channel(f"{axis}.command"),),
            outputs=(record.channel(f"{axis}.position"),),
            fs=record.fs,
            band=stimuli[axis].band,
            intersample=record.intersample,
        )
        single = hmpim.identify(alone).pairs[0].bandwidth_phase90.value
        pair = found[f"{axis}.position", f"{axis}.command"]
        assert pair.bandwidth_phase90.value == pytest.approx(single, rel=0.02)
    for pair in found.pairs:
        if pair.input.split(".")[0] != pair.output.split(".")[0]:
            assert pair.parameters.scale_factor is None  # inertia couples nothing at rest


@pytest.mark.study  # small: tests/campaign/test_compare.py, test_five_axes.py
def test_couplings_by_inertia_are_seen_where_they_are_and_nowhere_else(stimuli):
    table, _, found = together(stimuli, friction=False)
    seen = 0
    for pair in found.pairs:
        source, target = pair.input.split(".")[0], pair.output.split(".")[0]
        if source == target:
            continue
        response = pair.frequency_response
        exact = linear_response(
            table, response.frequency, axis_in=source, axis_out=target, hold="included"
        )
        largest = 20 * np.log10(np.abs(exact).max())
        if "weak_coupling" in [warning.code for warning in pair.warnings]:
            seen += 1
            assert largest > -60
        else:
            bound = float(pair.warnings[-1].message.split("below ")[1].split(" dB")[0])
            assert 20 * np.log10(np.quantile(np.abs(exact), 0.9)) < bound < -40
        assert np.median(np.abs(response.response - exact)) < 0.002
    assert seen >= 4
