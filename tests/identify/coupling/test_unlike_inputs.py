"""Inputs of one output that differ in size, in level and in what they do between samples."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.coupling import output_fit
from tests_support import in_studies

FS, SAMPLES = 100.0, 2000
NOISE = 0.01


def binary(seed, every):
    values = np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], SAMPLES // every + 1), every)
    return np.where(np.arange(SAMPLES) < 40, 0.0, values[:SAMPLES])


def sweep():
    time = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.1 * time + 0.4 * time**2))


def model(natural, damping, delay, gain):
    w = 2 * np.pi * natural
    denominator = (1 / w**2, 2 * damping / w, 1.0)
    return hmpim.Model(delay=delay, scale_factor=gain, denominator=denominator)


def identified(inputs, models, between, disturbance=0.0, structures=None):
    rng = np.random.default_rng(11)
    y = 0.5 + disturbance + NOISE * rng.standard_normal(SAMPLES)
    for u, unit, kind in zip(inputs, models, between, strict=True):
        y = y + hmpim.simulate(unit, u, fs=FS, intersample=kind)
    named = {f"u{j}": u for j, u in enumerate(inputs)}
    return hmpim.identify(hmpim.Record.from_arrays(named, {"y": y}, fs=FS), structures=structures)


def test_what_moves_the_output_little_is_found_with_its_dynamics_where_noise_is_less():
    models = (model(11.0, 0.9, 0.012, 0.7), model(2.1, 0.16, 0.03, 0.03))
    found = identified((binary(1, 1), binary(2, 5)), models, ("zoh", "zoh"))
    pair = found["y", "u1"]
    assert pair.structure == "second_order"
    assert pair.verdict == "ok"
    assert pair.natural_frequency.value == pytest.approx(2.1, abs=4 * pair.natural_frequency.std)
    assert pair.damping_ratio.value == pytest.approx(0.16, abs=4 * pair.damping_ratio.std)
    assert found["y", "u0"].noise_std.value == pytest.approx(NOISE, rel=0.08)


@pytest.mark.parametrize("gains", [(1.0, 0.1), (0.1, 1.0)])
def test_each_input_is_taken_for_what_it_does_between_its_own_samples(gains):
    models = (model(6.0, 0.5, 0.021, gains[0]), model(4.0, 0.8, 0.033, gains[1]))
    found = identified((sweep(), binary(3, 5)), models, ("bandlimited", "zoh"))
    for pair, delay, between in zip(
        found.pairs, (0.021, 0.033), ("bandlimited", "zoh"), strict=True
    ):
        assert (pair.intersample == "zoh") == (between == "zoh")
        low, high = pair.delay.ci95
        assert low - (high - low) / 2 < delay < high + (high - low) / 2
        assert pair.noise_std.value == pytest.approx(NOISE, rel=0.08)


def test_the_error_bar_of_a_bias_knows_how_far_from_zero_an_input_stands():
    models = (model(6.0, 0.5, 0.02, 1.0), model(4.0, 0.8, 0.03, 0.5))
    far = 3e7
    found = identified((sweep() + far, binary(4, 5)), models, ("bandlimited", "zoh"))
    pair = found["y", "u0"]
    assert pair.bias.std > 0.5 * far * pair.scale_factor.std
    assert abs(pair.bias.value - 0.5) < 4 * pair.bias.std


TIME = np.arange(SAMPLES) / FS
WARMING = 0.3 * np.exp(-TIME / 4.0)
HUM = 0.05 * np.sin(2 * np.pi * 23.3 * TIME + 1.0)


@pytest.mark.parametrize(
    ("disturbance", "codes"),
    [(WARMING + HUM, {"drift", "hum"}), *in_studies((WARMING, {"drift"}), (HUM, {"hum"}))],
)
def test_a_drift_and_a_hum_are_fitted_beside_several_inputs(disturbance, codes):
    models = (model(6.0, 0.5, 0.021, 1.0), model(4.0, 0.8, 0.033, 0.3))
    found = identified(
        (sweep(), binary(3, 5)),
        models,
        ("bandlimited", "zoh"),
        disturbance,
        structures=["first_order", "second_order"],
    )
    for pair, unit in zip(found.pairs, models, strict=True):
        assert codes <= {finding.code for finding in pair.warnings}
        assert pair.noise_std.value == pytest.approx(NOISE, rel=0.08)
        mean = 0.5 + float(np.mean(disturbance))
        assert pair.bias.value == pytest.approx(mean, abs=4 * pair.bias.std)
        assert pair.bias.std < 0.001
        assert abs(pair.scale_factor.value - unit.scale_factor) < 4 * pair.scale_factor.std
    whole = sum(
        pair.prediction - pair.bias.value - disturbance + np.mean(disturbance)
        for pair in found.pairs
    )
    residual = found.data.outputs[0].values - 0.5 - disturbance - whole
    assert np.std(residual) == pytest.approx(NOISE, rel=0.1)


@pytest.mark.parametrize(("frequency", "width"), [(0.7, 2.0), (0.7, 4.0), (0.3, 4.0)])
def test_no_search_is_spent_on_an_input_that_a_wobble_resembles(monkeypatch, frequency, width):
    # At the best lag a sweep correlates with any burst inside its band.
    searched = []

    def joint_fit(u, y, **options):
        searched.append(u)
        return whole(u, y, **options)

    whole = output_fit.joint_fit
    monkeypatch.setattr(output_fit, "joint_fit", joint_fit)
    time = np.arange(3000) / FS
    moving = np.sin(2 * np.pi * (0.1 * time + 0.1 * time**2))
    still = np.sin(2 * np.pi * (0.15 * time + 0.02 * time**2) + 1.0)
    burst = np.exp(-(((time - 20.0) / width) ** 2))
    y = hmpim.simulate(model(4.0, 0.5, 0.02, 1.0), moving, fs=FS, intersample="bandlimited")
    y = y + 0.2 * np.sin(2 * np.pi * frequency * time) * burst
    y = y + 0.002 * np.random.default_rng(1).standard_normal(time.size)
    found = hmpim.identify(
        hmpim.Record.from_arrays({"moving": moving, "still": still}, {"y": y}, fs=FS)
    )
    assert any(np.array_equal(u, moving) for u in searched)
    assert not any(np.array_equal(u, still) for u in searched)
    assert found["y", "still"].verdict == "not_identifiable"


def test_responses_are_measured_at_the_delay_of_the_leading_input():
    """Of an input that comes first, matters less and acts late, the delay is not the output's."""
    rng = np.random.default_rng(0)
    lesser, leading = binary(3, 10), sweep()
    late = np.concatenate([np.zeros(350), lesser[:-350]])
    y = leading + 0.4 * late + 0.02 * rng.standard_normal(SAMPLES)
    record = hmpim.Record.from_arrays({"b": lesser, "a": leading}, {"y": y}, fs=FS)
    response = hmpim.identify(record)["y", "a"].frequency_response.response
    assert np.median(np.abs(response - 1.0)) < 0.1
