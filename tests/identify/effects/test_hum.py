"""Mains hum on the output: found, taken off, and the error bars those of the noise alone."""

import numpy as np
import pytest

import hmpim
from tests_support import in_studies

FS = 200.0
SENSOR = hmpim.Sensor(
    delay=0.05, natural_frequency=6.0, damping_ratio=0.5, bias=0.3, noise_std=0.02
)
SWEEP = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0, amplitude=1.0), fs=FS)
TRUTH = {"delay": 0.05, "natural_frequency": 6.0, "damping_ratio": 0.5, "bias": 0.3}


def identified(lines, seed=3, drift=0.0, stimulus=SWEEP):
    """With lines (Hz, amplitude) added to the output."""
    record = hmpim.run(SENSOR, stimulus, rng=seed)
    t = np.arange(record.samples) / FS
    y = record.outputs[0].values + drift * t
    for k, (frequency, amplitude) in enumerate(lines):
        y = y + amplitude * np.sin(2 * np.pi * frequency * t + k)
    bare = hmpim.Record.from_arrays(
        {"u": record.inputs[0].values}, {"y": y}, fs=FS, intersample="bandlimited"
    )
    return hmpim.identify(bare)["y", "u"]


def said(pair):
    return [w.message for w in pair.warnings if w.code == "hum"]


@pytest.fixture(scope="module")
def silent():
    return identified([])


@pytest.mark.parametrize(
    "lines",
    [[(50.0, 0.1)], [(59.98, 0.2)], [(50.0, 0.1), (100.0, 0.03)], [(12.0, 0.1)]],
    ids=["50 Hz", "a little off 60 Hz", "a harmonic at half the rate", "within the sweep"],
)
def test_error_bars_are_those_of_the_noise_alone(lines, silent):
    pair = identified(lines)
    assert pair.verdict == "ok"
    assert len(said(pair)) == 1
    for frequency, _ in lines:
        assert f"{frequency:.4g} Hz (" in said(pair)[0]
    for name, truth in TRUTH.items():
        estimate, alone = getattr(pair, name), getattr(silent, name)
        assert abs(estimate.value - truth) < 4 * estimate.std, name
        assert estimate.std == pytest.approx(alone.std, rel=0.25), name
    assert pair.noise_std.value == pytest.approx(0.02, rel=0.06)


def test_the_amplitude_is_stated():
    assert "50 Hz (0.1" in said(identified([(50.0, 0.1)]))[0]


def test_hum_and_a_drift_at_once():
    pair = identified([(50.0, 0.1)], drift=0.1)
    assert len(said(pair)) == 1
    assert "drift" in {w.code for w in pair.warnings}
    assert pair.bias.value == pytest.approx(0.3 + 0.1 * 5.0, abs=5 * pair.bias.std)
    assert pair.noise_std.value == pytest.approx(0.02, rel=0.06)
    assert np.std(pair.residual) == pytest.approx(0.02, rel=0.06)


def test_the_prediction_holds_the_hum():
    pair = identified([(50.0, 0.1)])
    t = np.arange(pair.prediction.size) / FS
    hum = 0.1 * np.sin(2 * np.pi * 50.0 * t)
    calm = pair.prediction - hum
    assert np.abs(np.mean(calm * np.exp(2j * np.pi * 50.0 * t))) < 0.005


def test_no_line_is_found_in_noise(silent):
    assert said(silent) == []


def test_distortion_of_a_tone_is_no_hum():
    t = np.arange(2000) / FS
    u = np.sin(2 * np.pi * 3.0 * t)
    y = u + 0.1 * u**2 + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)
    assert said(hmpim.identify(record)["y", "u"]) == []


@pytest.mark.parametrize("seed", [0, *in_studies(1)])
def test_lines_that_the_input_has_are_no_hum(seed):
    """Sines so near to each other that none stands out, answered as no model here does."""
    t, rng = np.arange(1332) / FS, np.random.default_rng(seed)
    lines = (3.998, 5.631, 6.231, 7.77)
    answers = zip(lines, rng.uniform(0.3, 3.0, 4), rng.uniform(-3.0, 3.0, 4), strict=True)
    u = sum(np.sin(2 * np.pi * f * t + k) for k, f in enumerate(lines))
    y = sum(a * np.sin(2 * np.pi * f * t + k + p) for k, (f, a, p) in enumerate(answers))
    y = y + 0.01 * rng.standard_normal(t.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="bandlimited")
    pair = hmpim.identify(record, structures=["second_order", "third_order"])["y", "u"]
    assert said(pair) == []
