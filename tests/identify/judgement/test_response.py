"""A bandwidth that the measured response contradicts, and what of the model shapes it."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.signal

from hmpim import Record, identify
from hmpim.identify.judgement.response import bandwidth_disagrees
from tests_support import answer_of, field_chirp, second_order_lag


def test_a_clean_record_gives_no_finding(clean):
    assert not [*bandwidth_disagrees(clean)]


def moved(evidence, name, share):
    stated = getattr(evidence.readings.parameters, name)
    other = replace(stated, value=stated.value * (1 + share), std=0.001 * stated.value)
    return replace(evidence, measured=replace(evidence.measured, **{name: other}))


@pytest.mark.parametrize(
    ("name", "spared"),
    [
        ("bandwidth_phase90", {"bandwidth_3db", "scale_factor", "bias", "peak_gain_db"}),
        ("bandwidth_3db", {"bandwidth_phase90", "delay", "scale_factor", "bias"}),
    ],
)
def test_a_bandwidth_five_per_cent_apart_casts_doubt_on_itself_and_its_shape(clean, name, spared):
    (found,) = bandwidth_disagrees(moved(clean, name, 0.05))
    assert found.severity == "doubt"
    assert name in found.parameters
    assert not spared & set(found.parameters)


def test_two_per_cent_do_not_matter_and_a_held_output_shows_its_hold(clean):
    assert not [*bandwidth_disagrees(moved(clean, "bandwidth_phase90", 0.02))]
    assert not [*bandwidth_disagrees(replace(moved(clean, "bandwidth_phase90", 0.05), held=True))]


def test_both_apart_are_one_sentence_about_both(clean):
    both = moved(moved(clean, "bandwidth_phase90", 0.05), "bandwidth_3db", 0.05)
    (found,) = bandwidth_disagrees(both)
    assert {"bandwidth_phase90", "bandwidth_3db", "delay", "damping_ratio"} <= set(found.parameters)


def notched(delay):
    """A notch at 40 Hz: behind 0.002333 s its phase just touches -90 degrees."""
    fs, n = 500.0, 4000
    t = np.arange(n) / fs
    u = np.sin(2 * np.pi * (0.5 * t + 6.0 * t**2)) * np.hanning(n) ** 0.25
    f = np.fft.rfftfreq(2 * n, 1 / fs)
    s = 2j * np.pi * f / (2 * np.pi * 40.0)
    answer = (1 + 0.1 * s + s**2) / (1 + 1.6 * s + s**2) * np.exp(-2j * np.pi * f * delay)
    y = np.fft.irfft(np.fft.rfft(u, 2 * n) * answer, 2 * n)[:n]
    y += 0.01 * np.random.default_rng(4).standard_normal(n)
    record = Record.from_arrays({"u": u}, {"y": y}, fs=fs)
    return identify(record, structures=["second_order_zeros"])["y", "u"]


def test_a_bandwidth_that_the_phase_grazes_is_doubted_and_a_clear_one_is_not():
    clear = notched(0.006)
    assert "grazed_bandwidth" not in {w.code for w in clear.warnings}
    assert clear.bandwidth_phase90.verdict == "ok"
    grazing = notched(0.002333)
    (said,) = [w for w in grazing.warnings if w.code == "grazed_bandwidth"]
    assert (said.severity, said.parameters) == ("doubt", ("bandwidth_phase90",))


@pytest.mark.parametrize("rise", [190, 1])
def test_the_response_to_a_ramp_or_a_step_is_that_of_the_unit(rise):
    # The record ends elsewhere than it began: without differences that leaks into every bin.
    fs, n, fine = 500.0, 1500, 16
    t = np.arange(n * fine) / (fs * fine)
    u = np.interp(t - 0.2, [0.0, rise / fs], [0.0, 4.0])
    section = [1 / 57.0**2, 2 * 0.25 / 57.0, 1.0]
    moved = np.interp(t - 0.21, [0.0, rise / fs], [0.0, 4.0])
    y = answer_of(1.0, section, moved, t)[::fine]
    y += 0.002 * np.random.default_rng(2).standard_normal(n)
    pair = identify(Record.from_arrays({"u": u[::fine]}, {"y": y}, fs=fs, intersample="foh"))[
        "y", "u"
    ]
    seen = pair.frequency_response
    near = seen.frequency < 12.0
    truth = scipy.signal.freqs([1.0], section, 2 * np.pi * seen.frequency[near])[1]
    truth = truth * np.exp(-2j * np.pi * seen.frequency[near] * 0.01)
    error = np.abs(seen.response[near] - truth)
    assert np.all(error < np.maximum(0.05 * np.abs(truth), 5 * seen.std[near]))
    assert pair.verdict == "ok"


def test_what_the_estimator_makes_of_four_lines_is_not_held_against_the_model():
    # Between the lines a local fit is off by more than its error, of the model's own output too.
    fs, n, fine = 200.0, 3000, 8
    t = np.arange(n * fine) / (fs * fine)
    lines = (1.0, 3.1, 7.3, 12.7)

    def motion(time):
        return sum(np.where(time > 0, np.sin(2 * np.pi * f * time), 0.0) for f in lines)

    section = [1 / 50.0**2, 2 * 0.4 / 50.0, 1.0]
    y = answer_of(1.0, section, motion(t - 0.03), t)[::fine]
    y += 0.01 * np.random.default_rng(5).standard_normal(n)
    record = Record.from_arrays(
        {"u": motion(t[::fine])}, {"y": y}, fs=fs, intersample="bandlimited"
    )
    pair = identify(record)["y", "u"]
    assert pair.verdict == "ok"
    assert "bandwidth_disagrees" not in {finding.code for finding in pair.warnings}
    truth = np.sqrt(1 / section[0]) / (2 * np.pi)
    assert abs(pair.natural_frequency.value - truth) < 4.5 * pair.natural_frequency.spread


def measured_and_true(delay, structures=None):
    """The measured response of a resonance behind a delay, and the true one, in the band."""
    fs, n = 200.0, 2000
    time = np.arange(n) / fs
    omega, zeta = 2 * np.pi * 6.0, 0.15
    y = second_order_lag(time, field_chirp, delay=delay, natural_frequency=6.0, damping_ratio=zeta)
    y += 0.002 * np.random.default_rng(7).standard_normal(n)
    record = Record.from_arrays({"u": field_chirp(time)}, {"y": y}, fs=fs)
    pair = identify(record, structures=structures)["y", "u"]
    measured = pair.frequency_response
    s = 2j * np.pi * measured.frequency
    true = np.exp(-s * delay) / (1 + 2 * zeta * s / omega + (s / omega) ** 2)
    return measured, true


def test_motion_that_is_answered_after_the_record_does_not_bias_the_measured_response():
    measured, true = measured_and_true(delay=4.0)
    error = np.abs(measured.response - true)
    assert np.mean(error < 3 * measured.std) > 0.95
    assert np.mean(error < 0.05 * np.abs(true)) > 0.95


def test_the_measured_response_shows_what_the_model_misses():
    measured, true = measured_and_true(delay=0.05, structures=("first_order",))
    near = np.abs(measured.frequency - 6.0) < 2.0
    off = np.abs(measured.response[near] / true[near] - 1.0)
    assert np.max(np.abs(true)) > 3.0
    assert np.median(off) < 0.01
