"""A bandwidth that the measured response contradicts, and what of the model shapes it."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim import Record, identify
from hmpim.identify.judgement.response import bandwidth_disagrees


def test_a_clean_record_gives_no_finding(clean):
    assert bandwidth_disagrees(clean) == ()


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
    assert bandwidth_disagrees(moved(clean, "bandwidth_phase90", 0.02)) == ()
    assert bandwidth_disagrees(replace(moved(clean, "bandwidth_phase90", 0.05), held=True)) == ()


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
    return identify(record)["y", "u"]


def test_a_bandwidth_that_the_phase_grazes_is_doubted_and_a_clear_one_is_not():
    clear = notched(0.006)
    assert "grazed_bandwidth" not in {w.code for w in clear.warnings}
    assert clear.bandwidth_phase90.verdict == "ok"
    grazing = notched(0.002333)
    (said,) = [w for w in grazing.warnings if w.code == "grazed_bandwidth"]
    assert (said.severity, said.parameters) == ("doubt", ("bandwidth_phase90",))
