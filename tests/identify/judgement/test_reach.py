"""What lies outside the band, before the record's start or beyond its end."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy

import hmpim
from hmpim.identify.judgement.reach import (
    beyond_band,
    fast_mode,
    few_lines,
    initial_transient,
    integrator,
    natural_frequency_beyond,
    negative_delay,
    short_record,
)
from hmpim.identify.noise.spectra import windowed_power
from hmpim.identify.result import Estimate
from hmpim.identify.result.groups import MODELLED, PHASE_SPLIT
from hmpim.model.dynamics import STRUCTURES
from tests_support import field_chirp, second_order_lag

TIME = np.arange(2000) / 200.0
WHITE = 0.02 * np.random.default_rng(5).standard_normal(2000)


@pytest.mark.parametrize(
    "check",
    [
        beyond_band,
        fast_mode,
        initial_transient,
        integrator,
        natural_frequency_beyond,
        negative_delay,
        short_record,
    ],
)
def test_a_clean_record_gives_no_finding(clean, check):
    assert not [*check(clean)]


def test_what_was_left_out_at_the_beginning_is_information(clean):
    (found,) = initial_transient(replace(clean, joint=replace(clean.joint, forgotten=50)))
    assert (found.severity, found.parameters) == ("info", ())
    assert "first 0.25 s" in found.message


def test_a_resonance_beyond_the_band_casts_doubt_on_what_splits_the_phase(evidence_of):
    y = second_order_lag(TIME, field_chirp, delay=0.05, natural_frequency=30.0, damping_ratio=0.1)
    far = evidence_of(field_chirp(TIME), y + WHITE, structures=("second_order",))
    (found,) = natural_frequency_beyond(far)
    assert (found.code, found.severity, found.parameters) == ("extrapolated", "doubt", PHASE_SPLIT)
    assert re.search(r"ends at 20 Hz\. To see it, sweep to 4[45]\.?\d* Hz\.", found.message)
    (missing,) = beyond_band(far)
    assert missing.severity == "info"
    assert missing.parameters == ("bandwidth_phase90_without_delay", "bandwidth_3db")
    assert far.readings.parameters.bandwidth_phase90 is not None  # the delay alone: 5 Hz


def test_a_mode_far_beyond_the_band_casts_doubt_only_in_a_richer_structure(clean):
    """Poles at 100 Hz, five times the end of the band."""
    w = 200 * np.pi
    readings = replace(
        clean.readings,
        system=replace(
            clean.readings.system, denominator=np.convolve([1, 1 / w], [1, 1.4 / w, 1 / w**2])
        ),
    )
    best = clean.joint.best
    third = replace(best, fit=replace(best.fit, structure=STRUCTURES["third_order"]))
    evidence = replace(clean, readings=readings)
    assert not [*fast_mode(evidence)]
    (found,) = fast_mode(replace(evidence, joint=replace(clean.joint, best=third)))
    assert "sweep to 150 Hz, sampled at 380 Hz or faster" in found.message
    assert (found.code, found.severity, found.parameters) == ("extrapolated", "doubt", PHASE_SPLIT)
    assert "third-order model needs a mode at 100 Hz" in found.message
    coloured = replace(readings, white=False)  # it stands for something else, and not for all of it
    evidence = replace(evidence, readings=coloured, joint=replace(clean.joint, best=third))
    (found,) = fast_mode(replace(evidence, fit_percent=95.0))
    assert found.parameters == MODELLED
    (found,) = fast_mode(replace(evidence, fit_percent=99.0))  # the response is right either way
    assert found.parameters == PHASE_SPLIT


def test_an_integrating_output_has_no_bandwidth_to_miss(field_record, evidence_of):
    u = field_chirp(TIME)
    y = np.cumsum(u) / 200.0
    wanders = evidence_of(u, y + 0.01 * WHITE, structures=("integrator",))
    (found,) = integrator(wanders)
    assert found.severity == "info"
    assert "scale_factor" in found.parameters
    assert not [*beyond_band(wanders)]


def _slowed(evidence, time_constant, name="first_order"):
    """The same, of a pole of so many samples."""
    joint = evidence.joint
    structure = replace(STRUCTURES["first_order"], name=name)
    theta = np.array([joint.best.fit.delay, np.log(time_constant)])
    fit = replace(joint.best.fit, structure=structure, theta=theta)
    return replace(evidence, joint=replace(joint, best=replace(joint.best, fit=fit)))


def test_a_record_that_ends_before_the_system_settles_says_so(clean):
    """Five time constants of 2 s and the delay are 10.15 s of 10."""
    (found,) = short_record(_slowed(clean, 2.0 * clean.fs))
    assert (found.code, found.severity, found.parameters) == ("short_record", "info", MODELLED)
    assert "settling time of 10.15 s" in found.message
    assert not [*short_record(_slowed(clean, 1.9 * clean.fs))]


def test_an_output_before_its_input_casts_doubt_on_what_a_clock_moves(clean):
    p = clean.spanned

    def at(value):
        late = Estimate(value=value, std=0.001, ci95=(value - 0.002, value + 0.002), unit="s")
        return replace(clean, spanned=replace(p, delay=late))

    assert not [*negative_delay(at(-0.001))]  # zero is within its error
    (found,) = negative_delay(at(-0.003))
    assert (found.code, found.severity, found.parameters) == (
        "negative_delay",
        "doubt",
        PHASE_SPLIT,
    )


@pytest.mark.parametrize(("lines", "doubted"), [(1, True), (2, True), (20, False)])
def test_a_few_lines_tell_no_more_than_gain_and_phase_at_each(evidence_of, lines, doubted):
    frequencies = np.linspace(1.0, 19.0, lines + 2)[1:-1].round(1)
    u = np.sin(2 * np.pi * np.outer(TIME, frequencies) + np.arange(lines) ** 2).sum(axis=1)
    y = np.concatenate([np.zeros(10), u[:-10]])
    evidence = evidence_of(u, y + 0.01 * WHITE, structures=("second_order",))
    found = [*few_lines(evidence)]
    assert [f.code for f in found] == ["few_lines"] * doubted
    coloured = replace(evidence, readings=replace(evidence.readings, white=False))
    assert all("noise_std" in f.parameters for f in few_lines(coloured))
    for finding in found:
        assert finding.severity == "doubt"
        assert set(MODELLED) - set(finding.parameters) == {"bias", "noise_std"}
        assert f"excites {lines} frequenc" in finding.message


def test_a_start_from_rest_tells_more_than_lines_do():
    # A sweep of a few bins: gain and phase at one line, but what follows the start shows all.
    time = np.arange(100) / 100.0

    def drive(t):
        return np.where(t > 0, np.sin(2 * np.pi * (0.5 * t + 4.0 * t**2)), 0.0)

    y = second_order_lag(time, drive, delay=0.03, natural_frequency=6.0, damping_ratio=0.5)
    y += 0.002 * np.random.default_rng(3).standard_normal(100)
    (pair,) = hmpim.identify(hmpim.Record.from_arrays({"u": drive(time)}, {"y": y}, fs=100.0))
    assert pair.structure == "second_order"
    assert "few_lines" not in {warning.code for warning in pair.warnings}
    p = pair.parameters
    for estimate, truth in ((p.delay, 0.03), (p.natural_frequency, 6.0), (p.damping_ratio, 0.5)):
        assert estimate.verdict == "ok"
        assert abs(estimate.value - truth) < 4.0 * estimate.spread


def test_a_free_response_as_slow_as_a_drift_makes_the_bias_doubtful(clean):
    begun = replace(clean, joint=replace(clean.joint, forgotten=50))
    (found,) = initial_transient(_slowed(begun, clean.u.size / 10, "two_modes"))
    assert (found.severity, found.parameters) == (
        "doubt",
        ("bias", "time_constant", "natural_frequency", "damping_ratio"),
    )
    (found,) = initial_transient(_slowed(begun, clean.u.size / 100, "two_modes"))
    assert found.severity == "info"  # a fast mode is forgotten soon
    (found,) = initial_transient(_slowed(begun, clean.u.size / 10))
    assert found.severity == "info"  # a plain model has no such pole to spare


@pytest.mark.parametrize("samples", [64, 65, 1000])
def test_a_window_is_what_neighbouring_bins_add(samples):
    u = 5.0 + np.sin(np.arange(samples) ** 1.4)
    window = scipy.signal.windows.blackmanharris(samples, sym=False)
    level = (u - window @ u / window.sum()) * window
    wanted = np.abs(scipy.fft.rfft(level)) ** 2 * 2.0 / (window @ window * samples)
    assert windowed_power(u) == pytest.approx(wanted, rel=1e-9, abs=1e-14 * wanted.max())


@pytest.mark.parametrize(("start", "doubted"), [(0, False), (400, True)])
def test_what_an_integrator_had_before_the_record_is_part_of_its_bias(start, doubted):
    """From rest the input is none before the first sample; else the noise may hide what moved."""
    rng = np.random.default_rng(2)
    u = np.convolve(rng.standard_normal(2400), np.hanning(9) / 4, "same")
    u[:200] = 0.0
    y = 0.01 * np.cumsum(u) + 0.05 * rng.standard_normal(u.size)
    record = hmpim.Record.from_arrays({"u": u[start:]}, {"y": y[start:]}, fs=100.0)
    pair = hmpim.identify(record, structures=["integrator"]).pairs[0]
    codes = {w.code for w in pair.warnings if "bias" in w.parameters and w.severity == "doubt"}
    assert pair.structure == "integrator"
    assert ("initial_transient" in codes) == doubted


def test_a_line_at_half_the_rate_is_named_too():
    u = np.tile([0.0, 1.0], 50)
    result = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": u}, fs=10.0))
    codes = {warning.code for warning in result["y", "u"].warnings}
    assert "few_lines" in codes
    assert "check_failed" not in codes
