"""A result held against records it has not seen: right ones pass, changed units do not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

import hmpim
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify import Bounds, compare
from hmpim.units import conversion_factor
from tests_support import in_studies

LIMITS = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
SWEEP = hmpim.design(band=(0.1, 15), duration=8, fs=100, limits=LIMITS)
OTHER = hmpim.design(band=(0.3, 12), duration=12, fs=100, limits=LIMITS)
SENSOR = hmpim.Sensor(
    delay=0.083, natural_frequency=8, damping_ratio=0.5, bias=0.4, noise_std=0.05, scale_factor=1.5
)


@pytest.fixture(scope="module")
def result():
    return hmpim.identify(hmpim.run(SENSOR, SWEEP, rng=1))


def checks(validation) -> dict[str, bool]:
    (output,) = validation.outputs
    return {check.name: check.passed for check in output.checks}


def test_a_right_model_passes_on_other_records(result):
    passed = [
        hmpim.validate(result, hmpim.run(SENSOR, stimulus, rng=seed)).passed
        for seed in range(20, 23)
        for stimulus in (SWEEP, OTHER)
    ]
    assert all(passed)


def test_the_band_holds_95_percent(result):
    shares = []
    for seed in range(40, 45):
        (output,) = hmpim.validate(result, hmpim.run(SENSOR, OTHER, rng=seed)).outputs
        shares.append(next(c.value for c in output.checks if c.name == "coverage"))
    samples = 5 * OTHER.samples
    assert np.mean(shares) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / samples) + 0.008)


@pytest.mark.parametrize(
    ("changed", "failed"),
    [
        ({"delay": 0.085}, "follows_input"),
        ({"natural_frequency": 8.4}, "follows_input"),
        ({"scale_factor": 1.55}, "follows_input"),
        ({"noise_std": 0.08}, "noise_ratio"),
        ({"noise_colour": 0.7}, "whiteness"),
        ({"noise_std": 0.08}, "coverage"),
        ({"bias": 0.5}, "noise_ratio"),
    ],
)
def test_a_changed_unit_fails_where_it_has_changed(changed, failed, result):
    record = hmpim.run(replace(SENSOR, **changed), OTHER, rng=5)
    validation = hmpim.validate(result, record)
    assert not validation.passed
    assert not checks(validation)[failed]


def test_a_model_that_is_off_within_its_bars_passes_a_long_record():
    short = hmpim.design(band=(0.1, 15), duration=2, fs=100, limits=LIMITS)
    long = hmpim.design(band=(0.1, 15), duration=60, fs=100, limits=LIMITS)
    noisy = replace(SENSOR, noise_std=0.5)
    record = hmpim.run(noisy, long, rng=3)
    for seed in range(3):
        found = hmpim.identify(hmpim.run(noisy, short, rng=seed), structures=["second_order"])
        assert checks(hmpim.validate(found, record))["follows_input"]


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [([0.2], [1, -0.8]), ([0.2] * 5, [1]), signal.butter(2, 0.1), signal.butter(4, 0.05)],
)
@pytest.mark.parametrize("bias", [0.0, 3.0])
def test_exact_software_passes_whatever_its_rounding_looks_like(numerator, denominator, bias):
    def filtered(stimulus, error=0.0):
        u = np.asarray(stimulus.position)
        y = signal.lfilter(numerator, denominator, u) + bias + error * u
        return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0)

    result = hmpim.identify(filtered(SWEEP))
    assert result["y"].intersample == "sampled"
    assert hmpim.validate(result, filtered(OTHER)).passed
    (output,) = hmpim.validate(result, filtered(OTHER), bounds=Bounds(fit_percent=99)).outputs
    assert [check.name for check in output.checks if check.low is not None] == ["fit_percent"]
    assert not hmpim.validate(result, filtered(OTHER, error=1e-6)).passed


def test_what_is_bounded_is_what_is_asked(result):
    record = hmpim.run(replace(SENSOR, noise_std=0.08), OTHER, rng=5)
    loose = Bounds(noise_ratio=2.0, chance=1e-6)
    assert hmpim.validate(result, record, bounds=loose).passed
    assert hmpim.validate(result, record, bounds=Bounds(noise_ratio=None)).passed
    assert not hmpim.validate(result, record, bounds=replace(loose, fit_percent=99.9)).passed
    figures = hmpim.validate(result, record).to_dict()
    assert figures["passed"] is False
    assert {c["name"] for c in figures["outputs"][0]["checks"]} == {
        "fit_percent",
        "noise_ratio",
        "coverage",
        "follows_input",
        "whiteness",
    }


def test_checks_read_as_people_write_numbers(result):
    record = hmpim.run(replace(SENSOR, noise_std=0.08, noise_colour=0.9), OTHER, rng=5)
    (output,) = hmpim.validate(result, record).outputs
    found = {check.name: check for check in output.checks}
    assert found["whiteness"].value < 1e-10
    assert (found["whiteness"].text, found["whiteness"].bound) == (
        "below 0.0001",
        "at least 0.0001",
    )
    assert found["whiteness"].message == "The residual is coloured (p-value below 0.0001)."
    assert found["fit_percent"].text == f"{found['fit_percent'].value:.2f} %"
    assert found["coverage"].text == f"{100 * found['coverage'].value:.1f} %"
    assert found["coverage"].bound.endswith(" %")
    noise = result["y", "u"].parameters.noise_std.value
    assert f"noise {noise:.4g} deg, error of the model " in found["noise_ratio"].message
    assert found["noise_ratio"].message.endswith(" deg.")


def test_what_a_check_says_agrees_with_its_bound(result):
    """A test held to another p-value says what it finds at that one."""
    record = hmpim.run(replace(SENSOR, noise_colour=0.3), SWEEP, rng=3)
    (output,) = hmpim.validate(result, record).outputs
    (white,) = [check for check in output.checks if check.name == "whiteness"]
    assert white.passed == ("is white" in white.message)
    for chance in (0.5 * white.value, min(2.0 * white.value, 0.4)):
        (output,) = hmpim.validate(result, record, bounds=Bounds(chance=chance)).outputs
        (white,) = [check for check in output.checks if check.name == "whiteness"]
        assert white.passed == (chance < white.value) == ("is white" in white.message)


def test_clipped_and_held_outputs_are_predicted_as_such():
    # A record's hold has a phase of its own: it is found anew in each.
    unit = replace(SENSOR, saturation_high=9.0, hold_period=0.0231, quantization_step=0.02)
    fast = hmpim.design(band=(0.1, 10), duration=6, fs=200, limits=LIMITS)
    found = hmpim.identify(hmpim.run(unit, fast, rng=1))
    other = hmpim.design(band=(0.2, 9), duration=5, fs=200, limits=LIMITS)
    right = hmpim.run(replace(unit, hold_phase=0.007), other, rng=2)
    assert hmpim.validate(found, right).passed
    wrong = hmpim.run(replace(unit, hold_phase=0.007, delay=0.09), other, rng=2)
    assert not hmpim.validate(found, wrong).passed


def test_an_output_of_two_inputs_is_predicted_from_both():
    rng = np.random.default_rng(0)
    t = np.arange(3000) / 100

    def record(delay: float, seed: int) -> hmpim.Record:
        noise = np.random.default_rng(seed)
        a = np.sin(2 * np.pi * (0.2 * t + 0.15 * t**2))
        b = np.sin(2 * np.pi * (9.0 * t - 0.14 * t**2) + rng.uniform(0, 6))
        first = hmpim.Sensor(delay=0.05, time_constant=0.04).respond(a, fs=100.0)
        second = hmpim.Sensor(delay=delay, scale_factor=0.7).respond(b, fs=100.0)
        y = first + second + 0.3 + 0.05 * noise.standard_normal(t.size)
        return hmpim.Record.from_arrays({"a": a, "b": b}, {"y": y}, fs=100.0)

    found = hmpim.identify(record(0.03, 1), structures=["static", "first_order"])
    right = hmpim.validate(found, record(0.03, 2))
    assert right.passed, [c for o in right.outputs for c in o.checks if not c.passed]
    assert right.outputs[0].inputs == ("a", "b")
    wrong = hmpim.validate(found, record(0.04, 3))
    failed = {c.name for o in wrong.outputs for c in o.checks if not c.passed}
    assert "follows_b" in failed


def test_an_integrator_may_start_anywhere():
    rng = np.random.default_rng(4)
    t = np.arange(2000) / 100
    model = hmpim.Model(delay=0.04, scale_factor=2.0, denominator=(0.05, 1.0, 0.0))
    u = np.sin(2 * np.pi * (0.2 * t + 0.1 * t**2))
    clean = hmpim.simulate(model, u, fs=100.0, intersample="bandlimited")

    def record(start: float) -> hmpim.Record:
        y = clean + start + 0.01 * rng.standard_normal(t.size)
        return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0, intersample="bandlimited")

    found = hmpim.identify(record(0.0))
    assert found["y", "u"].structure.startswith("integrator")
    assert hmpim.validate(found, record(7.0)).passed


def test_what_cannot_be_validated_is_refused(result):
    record = hmpim.run(SENSOR, OTHER, rng=5)
    with pytest.raises(RecordError, match="samples of 'y' are left to score"):
        hmpim.validate(result, record.between(0.0, 0.7))
    renamed = hmpim.run(replace(SENSOR, output_name="z"), OTHER, rng=5)
    with pytest.raises(RecordError, match="no channel 'y'"):
        hmpim.validate(result, renamed)
    with pytest.raises(ArgumentError, match=r"noise_ratio = 0\.5"):
        Bounds(noise_ratio=0.5)
    with pytest.raises(ArgumentError, match="fit_percent = 100"):
        Bounds(fit_percent=100.0)
    with pytest.raises(ArgumentError, match="chance = 2"):
        Bounds(chance=2)


@pytest.mark.parametrize("units", [("rad", "deg"), ("deg", "rad"), ("rad", "rad")])
def test_a_record_in_other_units_is_refused_and_not_held_against_the_model(result, units):
    record = hmpim.run(SENSOR, OTHER, rng=5)
    u, y = (
        replace(channel, unit=unit)
        for channel, unit in zip((*record.inputs, *record.outputs), units, strict=True)
    )
    other = replace(record, inputs=(u,), outputs=(y,))
    with pytest.raises(RecordError, match=rf"record has '{units[0]}' and '{units[1]}'"):
        hmpim.validate(result, other)
    unstated = replace(record, inputs=(replace(u, unit=""),))
    assert hmpim.validate(result, unstated).passed


def test_two_results_of_one_unit_differ_by_chance_only(result):
    for seed in range(60, 63):
        again = hmpim.identify(hmpim.run(SENSOR, SWEEP, rng=seed), structures=["second_order"])
        assert not any(change.changed for change in compare(again, result))


def test_a_repair_shows_in_what_it_changed(result):
    repaired = hmpim.identify(hmpim.run(replace(SENSOR, damping_ratio=0.7), SWEEP, rng=9))
    changed = {change.name for change in compare(repaired, result) if change.changed}
    assert "damping_ratio" in changed
    assert "bandwidth_3db" in changed or "bandwidth_phase90" in changed
    assert not {"bias", "scale_factor", "noise_std"} & changed
    (delay,) = [c for c in compare(repaired, result) if c.name == "natural_frequency"]
    assert delay.deviations == pytest.approx(
        (delay.new.value - delay.old.value) / np.hypot(delay.new.std, delay.old.std)
    )


def test_results_of_different_units_are_not_compared(result):
    other = hmpim.identify(hmpim.run(replace(SENSOR, output_name="z"), SWEEP, rng=2))
    with pytest.raises(RecordError, match="no parameter in common"):
        compare(other, result)


def in_units(record, u_unit, y_unit):
    """The record with the values in other units: the sensor itself is in degrees."""
    return replace(
        record,
        inputs=tuple(_in_unit(c, u_unit) for c in record.inputs),
        outputs=tuple(_in_unit(c, y_unit) for c in record.outputs),
    )


def _in_unit(channel, unit):
    factor = conversion_factor("deg", to=unit) if unit in ("deg", "rad", "mrad") else 1.0
    return replace(channel, values=channel.values * factor, unit=unit)


@pytest.mark.parametrize(
    "units", [("deg", "rad"), ("rad", "deg"), ("mrad", "mrad"), ("", "rad"), ("rad", "rad")]
)
def test_figures_in_other_units_are_converted_before_they_are_compared(result, units):
    record = hmpim.run(SENSOR, SWEEP, rng=61)
    plain = compare(hmpim.identify(record), result)
    there = compare(hmpim.identify(in_units(record, *units)), result)
    back = compare(result, hmpim.identify(in_units(record, *units)))
    assert [c.name for c in there] == [c.name for c in plain]
    for same, other, reverse in zip(plain, there, back, strict=True):
        assert other.deviations == pytest.approx(same.deviations, rel=1e-3, abs=1e-3)
        assert reverse.deviations == pytest.approx(-same.deviations, rel=1e-3, abs=1e-3)
        assert other.old.unit == other.new.unit


def test_figures_without_a_unit_are_compared_as_they_are(result):
    found = hmpim.identify(in_units(hmpim.run(SENSOR, SWEEP, rng=61), "", ""))
    assert not any(change.changed for change in compare(found, result))
    assert not any(change.changed for change in compare(result, found))


def test_figures_whose_units_cannot_be_converted_are_not_compared(result):
    found = hmpim.identify(in_units(hmpim.run(SENSOR, SWEEP, rng=61), "deg", "V"))
    with pytest.raises(RecordError, match="scale factor of 'y' from 'u' is in 'V/deg', and in '1'"):
        compare(found, result)


def test_a_delay_that_its_record_left_open_is_validated(result):
    """Draws of it ran ahead by more samples than there is memory for."""
    pair = result.pairs[0]
    left_open = pair.covariance.copy()
    left_open[0, :] = left_open[:, 0] = 0.0
    left_open[0, 0] = 1e28
    unsure = replace(result, pairs=(replace(pair, covariance=left_open),))
    (output,) = hmpim.validate(unsure, hmpim.run(SENSOR, SWEEP, rng=2)).outputs
    assert np.isfinite(output.std).all()


@pytest.mark.parametrize(
    ("damping", "begins"), [(0.05, 2.0), (0.4, 4.0), *in_studies((0.05, 4.0), (0.4, 2.0))]
)
def test_a_right_model_is_valid_on_a_record_that_begins_in_motion(damping, begins):
    """Five time constants after the beginning its free response is many times the noise."""
    sensor = replace(SENSOR, natural_frequency=5, damping_ratio=damping, noise_std=0.001)
    found = hmpim.identify(hmpim.run(sensor, SWEEP, rng=1), structures=["second_order"])
    whole = hmpim.run(sensor, SWEEP, rng=2)
    assert hmpim.validate(found, cut(whole, begins)).passed
    other = replace(sensor, natural_frequency=5.01)
    assert not hmpim.validate(found, cut(hmpim.run(other, SWEEP, rng=2), begins)).passed


def cut(record, begins):
    def later(channels):
        return tuple(
            replace(c, time=c.time[c.time >= begins], values=c.values[c.time >= begins])
            for c in channels
        )

    return replace(record, inputs=later(record.inputs), outputs=later(record.outputs))
