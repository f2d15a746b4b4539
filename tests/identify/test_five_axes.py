"""Five inputs and five outputs in one record: every coupling with its bars, or how small it is."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.report import render
from hmpim.report.inputs import gain_rows
from tests_support import assert_share

FS = 250.0
AXES = ("roll", "yaw", "pitch", "azimuth", "elevation")
TIME = np.arange(2500) / FS
# First and last frequency in Hz, begin and end in s.
MOTIONS = (
    (0.2, 40.0, 0.1, 9.5),
    (36.0, 0.3, 0.1, 9.3),
    (0.2, 32.0, 3.0, 9.4),
    (20.0, 0.5, 1.0, 7.0),
    (0.5, 18.0, 0.2, 5.5),
)
DIRECT = ((20.0, 0.7, 0.004), (18.0, 0.6, 0.006), (15.0, 0.7, 0.005), (10.0, 0.6, 0.008))
DIRECT = (*DIRECT, (8.0, 0.7, 0.010))


def second_order(natural, damping):
    w = 2 * np.pi * natural
    return (1 / w**2, 2 * damping / w, 1.0)


def sweep(first, last, begin, end):
    """From rest to rest, 4 deg at low frequencies and falling with the frequency."""
    share = np.clip((TIME - begin) / (end - begin), 0.0, 1.0)
    frequency = first + (last - first) * share
    phase = 2 * np.pi * (end - begin) * (first * share + 0.5 * (last - first) * share**2)
    edge = np.clip(np.minimum(share, 1.0 - share) * 20.0, 0.0, 1.0)
    return 4.0 * np.sin(0.5 * np.pi * edge) ** 2 * np.sin(phase) / (1.0 + frequency / 4.0)


# Output, input: scale factor, delay, denominator.
COUPLED = {
    (0, 1): (0.05, 0.010, second_order(12.0, 0.5)),
    (1, 0): (-0.03, 0.006, (0.02, 1.0)),
    (1, 2): (0.03, 0.0213, second_order(9.0, 0.4)),
    (3, 4): (0.05, 0.030, second_order(6.0, 0.6)),
    (4, 3): (-0.04, 0.015, second_order(7.0, 0.4)),
    (2, 4): (0.03, 0.012, (0.03, 1.0)),
    (4, 0): (0.03, 0.008, (1.0,)),
    (0, 3): (0.0005, 0.01, (0.02, 1.0)),  # below the noise
}
TOO_WEAK = (0, 3)


def second_order_truth(denominator):
    w = 1 / np.sqrt(denominator[0])
    return {"natural_frequency": w / (2 * np.pi), "damping_ratio": denominator[1] * w / 2}


def truth(i, j):
    if i == j:
        natural, damping, delay = DIRECT[i]
        return {"scale_factor": 1.0, "delay": delay} | second_order_truth(
            second_order(natural, damping)
        )
    gain, delay, denominator = COUPLED[i, j]
    known = {"scale_factor": gain, "delay": delay}
    if len(denominator) == 3:
        known |= second_order_truth(denominator)
    if len(denominator) == 2:
        known["time_constant"] = denominator[0]
    return known


@pytest.fixture(scope="module")
def clean():
    inputs = [sweep(*motion) for motion in MOTIONS]
    outputs = []
    for i in range(5):
        y = np.full(inputs[0].size, 0.1 * i)
        for j, u in enumerate(inputs):
            if i == j:
                natural, damping, delay = DIRECT[i]
                model = (1.0, delay, second_order(natural, damping))
            elif (i, j) in COUPLED:
                model = COUPLED[i, j]
            else:
                continue
            gain, delay, denominator = model
            system = hmpim.Model(delay=delay, scale_factor=gain, denominator=denominator)
            y = y + hmpim.simulate(system, u, fs=FS, intersample="bandlimited")
        outputs.append(y)
    return inputs, outputs


def identified(clean, seed, structures=None):
    inputs, outputs = clean
    rng = np.random.default_rng(seed)
    return hmpim.identify(
        hmpim.Record.from_arrays(
            {f"{a}.command": u for a, u in zip(AXES, inputs, strict=True)},
            {
                f"{a}.position": y + 0.01 * rng.standard_normal(y.size)
                for a, y in zip(AXES, outputs, strict=True)
            },
            fs=FS,
            intersample="bandlimited",
        ),
        structures=structures,
    )


def pair_of(result, i, j):
    return result[f"{AXES[i]}.position", f"{AXES[j]}.command"]


@pytest.fixture(scope="module")
def result(clean):
    return identified(clean, 0, structures=["static", "first_order", "second_order"])


def test_couplings_are_found_and_none_is_invented(result):
    for i in range(5):
        for j in range(5):
            pair = pair_of(result, i, j)
            real = i == j or ((i, j) in COUPLED and (i, j) != TOO_WEAK)
            assert (pair.parameters.scale_factor is not None) == real, (AXES[j], AXES[i])
            if not real:
                assert [w.code for w in pair.warnings] == ["unrelated"]
                assert "any coupling is below -" in pair.warnings[0].message


def test_no_estimate_is_no_number(result):
    for pair in result.pairs:
        for name in type(pair.parameters).__dataclass_fields__:
            estimate = getattr(pair.parameters, name)
            if estimate is not None:
                assert np.all(np.isfinite([estimate.value, estimate.std, *estimate.ci95])), name
        assert np.all(np.isfinite(pair.frequency_response.std))


def test_the_bound_of_what_is_too_weak_holds(result):
    pair = pair_of(result, *TOO_WEAK)
    words = pair.warnings[0].message.split("below ")[1]
    assert 20 * np.log10(COUPLED[TOO_WEAK][0]) < float(words.split(" dB")[0]) < -40


def test_coherence_tells_what_drives_what(result):
    assert [c.output for c in result.inputs.coherence] == [f"{a}.position" for a in AXES]
    for i, seen in enumerate(result.inputs.coherence):
        # Where the output's own axis moves: beyond it there is nothing to be coherent with.
        inside = (seen.frequency > 0.5) & (seen.frequency < 0.8 * DIRECT[i][0])
        assert seen.multiple[inside].min() > 0.9
        own = pair_of(result, i, i).frequency_response
        assert np.median(own.coherence[own.frequency < DIRECT[i][0]]) > 0.98
    none = pair_of(result, 3, 1).frequency_response
    assert np.median(none.coherence) < 0.2


def test_the_result_is_read_back_as_written(result):
    written = result.to_dict()
    assert written["inputs"]["names"] == [f"{a}.command" for a in AXES]
    assert hmpim.Identification.from_dict(written).to_dict() == written


@pytest.mark.few(1)
def test_intervals_hold_the_truth(clean, result, seeds):
    inside = {True: [], False: []}
    missed = invented = 0
    for found in (result, *(identified(clean, seed) for seed in range(1, seeds))):
        for i in range(5):
            for j in range(5):
                pair = pair_of(found, i, j)
                real = i == j or ((i, j) in COUPLED and (i, j) != TOO_WEAK)
                told = pair.parameters.scale_factor is not None
                missed += real and not told
                invented += told and not real
                for name, value in truth(i, j).items() if real else ():
                    estimate = getattr(pair.parameters, name)
                    if estimate is not None:
                        inside[i == j].append(estimate.ci95[0] <= value <= estimate.ci95[1])
    assert invented == 0
    assert missed == 0
    for held in inside.values():
        assert_share(held, at_least=0.92, at_most=0.98)


def test_an_axis_that_is_not_coupled_is_no_failure(result):
    assert len(result.counted) == 5 + len(COUPLED) - 1
    assert all(pair.parameters.scale_factor is not None for pair in result.counted)
    assert result.verdict != "not_identifiable"


def test_every_coupling_stands_in_one_table(result):
    rows = gain_rows(result)
    assert [row["name"] for row in rows] == [f"{axis}.command" for axis in AXES]
    for j, row in enumerate(rows):
        for i, cell in enumerate(row["cells"]):
            real = i == j or ((i, j) in COUPLED and (i, j) != TOO_WEAK)
            assert (cell == "–") != real
            if real:
                known = truth(i, j)["scale_factor"]
                assert float(cell.split(" ± ")[0].strip("(")) == pytest.approx(known, abs=0.01)


def test_the_page_shows_the_inputs(result):
    text = render(replace(result, pairs=result.pairs[:0], data=None))
    assert "Inputs driven together" in text
    assert "Multiple coherence" in text or "multiple coherence" in text
    assert "roll.command" in text
