"""Curves of a Bode plot against closed forms, and their bands against many draws."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.identify import (
    Estimate,
    FrequencyResponse,
    PairIdentification,
    PaperEstimates,
    Parameters,
)
from hmpim.model import delayed_response, prepare_input
from hmpim.plots import bode
from hmpim.plots.curves import (
    BodeCurve,
    decibels,
    deviation_curve,
    measured_curve,
    model_curve,
    output_hold,
    stretches,
)
from hmpim.plots.description import Band, Curve, Points

NOTHING = np.empty(0)


def known(value):
    return Estimate(value=value, std=0.0, ci95=(value, value))


def a_pair(*, delay=0.15, scale=1.0, fn=10.0, damping=0.4, intersample="bandlimited"):
    omega = 2 * np.pi * fn
    return PairIdentification(
        input="u",
        output="y",
        structure="second_order",
        intersample=intersample,
        fit_percent=100.0,
        parameters=Parameters(delay=known(delay), scale_factor=known(scale)),
        paper=PaperEstimates(),
        frequency_response=FrequencyResponse(
            frequency=NOTHING, response=NOTHING.astype(complex), std=NOTHING
        ),
        numerator=(omega**2,),
        denominator=(1.0, 2 * damping * omega, omega**2),
        candidates=(),
        verdict="ok",
        warnings=(),
    )


@given(
    delay=st.floats(0.0, 0.3),
    scale=st.floats(0.1, 5.0) | st.floats(-5.0, -0.1),
    fn=st.floats(1.0, 50.0),
    damping=st.floats(0.05, 2.0),
)
def test_the_model_is_the_second_order_lag_in_closed_form(delay, scale, fn, damping):
    f = np.array([0.01, 0.3, 1.0, 7.0, 33.0, 90.0])
    curve = model_curve(a_pair(delay=delay, scale=scale, fn=fn, damping=damping), f)
    x = f / fn
    lag = np.degrees(np.arctan2(2 * damping * x, 1 - x**2))
    expected = -360 * f * delay - lag - (180 if scale < 0 else 0)
    np.testing.assert_allclose(curve.phase, expected, atol=1e-6)
    size = abs(scale) / np.hypot(1 - x**2, 2 * damping * x)
    np.testing.assert_allclose(curve.magnitude_db, 20 * np.log10(size), atol=1e-6)


def test_without_delay_the_phase_is_minus_90_at_the_natural_frequency():
    curve = model_curve(a_pair(), np.array([10.0]), with_delay=False)
    assert curve.phase[0] == pytest.approx(-90.0, abs=1e-9)


@pytest.mark.parametrize("intersample", ["zoh", "foh"])
def test_seen_through_samples_the_model_is_the_transform_of_the_simulated_pulse(intersample):
    """The response to one sample, simulated in time, against the folded sum over aliases."""
    fs, n = 200.0, 4000
    pair = a_pair(delay=0.0137, fn=20.0, scale=3.0, intersample=intersample)
    pulse = np.zeros(n)
    pulse[1] = 1.0
    # Simulated in samples: coefficients by rising powers of s/fs, unit gain at DC.
    rising = np.array(pair.denominator[::-1])
    scaled = rising / rising[0] * fs ** np.arange(3)
    y = delayed_response(prepare_input(pulse, intersample), delay=0.0137 * fs, denominator=scaled)[
        0
    ]
    f = np.array([1.0, 5.0, 20.0, 60.0, 95.0])
    k = np.arange(n)
    transform = 3.0 * np.exp(-2j * np.pi * np.outer(f, k - 1) / fs) @ y
    curve = model_curve(pair, f, fs=fs)
    np.testing.assert_allclose(curve.magnitude_db, decibels(transform), atol=2e-3)
    turned = np.degrees(np.angle(transform))
    np.testing.assert_allclose((curve.phase - turned + 180) % 360 - 180, 0.0, atol=2e-2)


def test_a_band_limited_input_needs_no_hold():
    f = np.array([1.0, 50.0])
    plain, seen = model_curve(a_pair(), f), model_curve(a_pair(), f, fs=200.0)
    np.testing.assert_array_equal(plain.phase, seen.phase)


def test_no_model_no_curve():
    pair = replace(a_pair(), parameters=Parameters())
    assert model_curve(pair, np.array([1.0])) is None


def test_the_bands_hold_the_truth_in_95_of_100_draws():
    rng = np.random.default_rng(5)
    draws, std, truth = 20_000, 0.05, 0.8 * np.exp(-1j)
    error = std / np.sqrt(2) * (rng.standard_normal(draws) + 1j * rng.standard_normal(draws))
    curve = measured_curve(
        FrequencyResponse(
            frequency=np.arange(1.0, draws + 1),
            response=truth + error,
            std=np.full(draws, std),
        )
    )
    size, angle = decibels(np.array([truth]))[0], np.degrees(np.angle(truth))
    in_size = np.mean((curve.magnitude_low < size) & (size < curve.magnitude_high))
    in_angle = np.mean((curve.phase_low < angle) & (angle < curve.phase_high))
    # The standard error of a share of 20 000 is 0.0015; curvature costs as little.
    assert in_size == pytest.approx(0.95, abs=0.006)
    assert in_angle == pytest.approx(0.95, abs=0.006)


def test_where_the_error_reaches_the_response_its_phase_is_unknown():
    curve = measured_curve(
        FrequencyResponse(
            frequency=np.array([1.0]), response=np.array([0.1 + 0j]), std=np.array([1.0])
        )
    )
    assert curve.phase_high[0] - curve.phase_low[0] == 360.0
    assert curve.magnitude_low[0] == -np.inf


def test_the_measured_phase_follows_the_model_over_many_turns_and_gaps():
    pair = a_pair(delay=0.5)
    f = np.array([0.5, 3.0, 17.0, 40.0])  # far more than half a turn between them
    model = model_curve(pair, f)
    value = 10 ** (model.magnitude_db / 20) * np.exp(1j * np.radians(model.phase + 5.0))
    measured = measured_curve(
        FrequencyResponse(frequency=f, response=value, std=np.full(4, 0.01)), near=model
    )
    deviation = deviation_curve(measured, model)
    np.testing.assert_allclose(deviation.phase, 5.0, atol=1e-9)
    np.testing.assert_allclose(deviation.magnitude_db, 0.0, atol=1e-9)
    np.testing.assert_allclose(
        deviation.phase_high - deviation.phase, deviation.phase - deviation.phase_low
    )


@pytest.mark.parametrize(("period", "fs"), [(0.02, 200.0), (0.01713, 200.0), (0.05, 1000.0)])
def test_an_output_that_is_held_is_late_by_the_mean_age_of_its_values(period, fs):
    """A tone sampled through a hold, against the tone itself, over many updates."""
    n = 60_000
    t = np.arange(n) / fs
    taken = np.floor(t / period + 1e-9) * period  # when the value shown was taken
    f = np.array([0.3, 2.0, 7.0])
    tone = np.exp(2j * np.pi * np.outer(f, taken))
    seen = np.mean(tone * np.exp(-2j * np.pi * np.outer(f, t)), axis=1)
    np.testing.assert_allclose(output_hold(f, period=period, fs=fs), seen, atol=3e-3)


def test_seen_through_samples_a_held_output_is_in_the_model():
    pair = a_pair(delay=0.01)
    held = replace(pair, parameters=replace(pair.parameters, hold_period=known(0.05)))
    f = np.array([1.0, 4.0])
    late = output_hold(f, period=0.05, fs=200.0)
    plain, seen = (model_curve(each, f, fs=200.0) for each in (pair, held))
    np.testing.assert_allclose(seen.phase - plain.phase, np.degrees(np.angle(late)))
    np.testing.assert_allclose(seen.magnitude_db - plain.magnitude_db, decibels(late))
    np.testing.assert_array_equal(model_curve(held, f).phase, model_curve(pair, f).phase)


def two_bands(step=0.1):
    """Frequencies from 0.1 to 0.7 Hz and from 3 to 9 Hz."""
    every = step * np.arange(1, 91)
    return every[(every < 0.75) | (every > 2.95)]


def test_line_and_band_are_interrupted_where_nothing_was_measured():
    f = two_bands()
    curve = measured_curve(FrequencyResponse(frequency=f, response=1 + 0j * f, std=0.1 + 0 * f))
    figure = bode([("measured", "input", curve)])
    for panel in figure.panels:
        bands, (line,) = panel.of(Band), panel.of(Curve)
        assert [(b.x[0].round(1), b.x[-1].round(1)) for b in bands] == [(0.1, 0.7), (3.0, 9.0)]
        gap = ~np.isfinite(line.y)
        assert line.x[gap] == pytest.approx([1.85])
        assert np.isfinite(panel.of(Points)[0].y).all()
    assert [b.label for b in figure.panels[0].of(Band)] == ["95 % band", ""]


@pytest.mark.parametrize(
    "f",
    [
        0.1 * np.arange(1, 400),
        np.geomspace(0.1, 20.0, 400),
        0.05 * np.unique(np.rint(np.geomspace(1, 4000, 400))),  # whole bins, as they are thinned
        np.array([1.0, 5.0]),
    ],
)
def test_a_grid_without_a_gap_is_one_stretch(f):
    assert stretches(f) == [slice(0, f.size)]


def test_the_first_and_the_last_mark_are_seen_whole():
    f = np.geomspace(0.1, 20.0, 50)
    flat = np.zeros(50)
    (axis, _) = (
        p.x
        for p in bode(
            [("a", "model", BodeCurve(frequency=f, magnitude_db=flat, phase=flat))]
        ).panels
    )
    assert axis.low < 0.99 * f[0]
    assert axis.high > 1.01 * f[-1]
