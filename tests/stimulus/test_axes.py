"""Several axes at once: told apart from one record, or refused by name."""

import numpy as np
import pytest

from hmpim.errors import ArgumentError, LimitsError
from hmpim.identify.frf.multivariable import joint_response
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, Sweep, design
from hmpim.stimulus.axes import (
    AxisPlan,
    InputCondition,
    condition_table,
    design_axes,
    input_condition,
)

FS = 200.0
LIMITS = Limits(position=10, velocity=200, acceleration=8000, unit="deg")
NAMES = ("roll", "pitch", "yaw")


def plans(names=NAMES, band=(0.5, 20.0)):
    return [AxisPlan(axis=name, limits=LIMITS, band=band) for name in names]


@pytest.fixture(scope="module", params=["sweeps", "multisines"])
def three(request):
    return design_axes(plans(), duration=10, fs=FS, method=request.param)


def test_all_fill_the_record_inside_their_limits_from_rest_to_rest(three):
    assert [s.axis for s in three] == list(NAMES)
    for stimulus in three:
        assert stimulus.samples == 2000
        assert LIMITS.use(stimulus.peaks) <= 1.0 + 1e-9
        assert stimulus.position[0] == stimulus.position[-1] == 0.0
        assert not np.any(stimulus.position[-int(0.4 * FS) :])  # the tail
        assert np.ptp(stimulus.position) > 5.0


def test_five_per_cent_coupling_within_half_a_per_cent(three):
    """Second-order axes, each coupled to the others by 5 %, stepped in time, noise added."""
    natural = (30.0, 25.0, 20.0)
    coupling = np.array([[1.0, 0.05, -0.05], [0.05, 1.0, 0.05], [-0.05, 0.05, 1.0]])
    u = np.array([s.position for s in three])
    rng = np.random.default_rng(5)
    apart = input_condition(three, band=(0.7, 19.0))
    for i, (row, frequency) in enumerate(zip(coupling, natural, strict=True)):
        sensor = Sensor(delay=0.03, natural_frequency=frequency, damping_ratio=0.6, noise_std=0.005)
        y = sensor.respond(row @ u, fs=FS, rng=rng)
        found = joint_response(
            u,
            y,
            FS,
            predicted=np.zeros(y.size),
            delay=0.03,
            band=(0.7, 19.0),
            valid=None,
            names=[*NAMES, "y"],
        )
        declared = np.interp(found.frequency, apart.frequency, apart.condition) <= apart.bound
        assert declared.mean() > 0.95
        here = found.inputs[0].frequency
        both = np.isin(here, found.frequency[declared])
        assert both.sum() > 0.95 * declared.size
        s, omega = 2j * np.pi * here, 2 * np.pi * frequency
        direct = omega**2 / (s**2 + 1.2 * omega * s + omega**2) * np.exp(-0.03 * s)
        for j in range(3):
            if i != j:
                off = np.abs(found.inputs[j].response - coupling[i, j] * direct)
                assert np.max(off[both]) <= 0.005, (NAMES[i], NAMES[j])


def test_no_axis_is_a_delayed_copy_of_another_with_a_wider_band():
    """Three quarters of the band in three quarters of the time would be the same sweep rate."""
    bands = (10.0, 10.0, 10.0, 7.5, 7.5)
    plan = [AxisPlan(axis=str(k), limits=LIMITS, band=(0.5, b)) for k, b in enumerate(bands)]
    five = design_axes(plan, duration=10, fs=FS / 2)
    for later, earlier in ((3, 0), (4, 1)):
        spectra = np.fft.rfft([five[later].position, five[earlier].position], 8192)
        alike = np.fft.irfft(spectra[0] * np.conj(spectra[1]))
        size = np.linalg.norm(five[later].position) * np.linalg.norm(five[earlier].position)
        assert np.max(np.abs(alike)) < 0.9 * size  # 0.99 at one sweep rate


def test_five_axes_at_once():
    five = design_axes(plans(tuple("abcde"), band=(0.5, 10.0)), duration=10, fs=FS / 2)
    assert {s.samples for s in five} == {1000}
    assert input_condition(five, band=(1.0, 9.5)).share > 0.9


def test_the_condition_of_orthogonal_lines_is_one_and_of_mixed_ones_as_mixed():
    """cos and sin of many lines, then one of them leaked into the other: cond from algebra."""
    t = np.arange(4000) / FS
    rng = np.random.default_rng(1)
    lines = np.arange(20, 400)
    parts = np.zeros((2, t.size))
    for k in lines:
        parts[k % 2] += np.cos(2 * np.pi * k * t / 20.0 + rng.uniform(0, 6))
    even = input_condition(parts, fs=FS, band=(2.0, 18.0))
    assert np.median(even.condition) == pytest.approx(1.0, abs=0.1)
    leak = np.array([parts[0], parts[0] + 0.2 * parts[1]])
    cosine = 1.0 / np.hypot(1.0, 0.2)
    expected = np.sqrt((1 + cosine) / (1 - cosine))
    assert np.median(input_condition(leak, fs=FS, band=(2.0, 18.0)).condition) == pytest.approx(
        expected, rel=0.1
    )


def test_scale_does_not_matter_and_a_missing_axis_is_infinite():
    t = np.arange(2000) / FS
    up = np.sin(2 * np.pi * (0.1 * t + t**2))
    one = input_condition([up, up[::-1]], fs=FS, band=(1.0, 19.0))
    other = input_condition([1e3 * up, up[::-1]], fs=FS, band=(1.0, 19.0))
    np.testing.assert_allclose(one.condition, other.condition, rtol=1e-9)
    slow = np.hanning(t.size) * np.sin(2 * np.pi * 3 * t)
    assert np.all(np.isinf(input_condition([slow, up], fs=FS, band=(2.0, 18.0)).condition[-40:]))


def test_the_table_says_where():
    frequency = np.array([1.0, 1.5, 3.0, 4.0])
    found = InputCondition(
        names=("a", "b"), frequency=frequency, condition=np.array([1.0, 1.0, 40.0, 2.0]), bound=10
    )
    lines = condition_table(found).splitlines()
    assert "75 % of the frequencies" in lines[0]
    assert "worst 40" in lines[2]
    assert "usable 50 %" in lines[2]


def test_the_same_stimulus_on_two_axes_is_refused_by_name():
    same = [
        design(band=(0.5, 20), duration=9, fs=FS, limits=LIMITS, axis=name) for name in NAMES[:2]
    ]
    with pytest.raises(ArgumentError, match=r"roll and pitch are driven by the same stimulus"):
        input_condition(same, band=(1, 19))
    up = same[0].position
    with pytest.raises(ArgumentError, match="x and z are driven by the same"):
        input_condition([up, up[::-1], -3.0 * up], fs=FS, band=(1, 19), names=["x", "y", "z"])
    mixed = [up, up[::-1], up - 2.0 * up[::-1]]
    with pytest.raises(ArgumentError, match=r"x, y, z are sums of one another"):
        input_condition(mixed, fs=FS, band=(1, 19), names=["x", "y", "z"])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: design_axes([], duration=10, fs=FS), "must be different names"),
        (lambda: design_axes(plans(("a", "a")), duration=10, fs=FS), "must be different names"),
        (lambda: design_axes(plans(), duration=0.4, fs=FS), "leaves no time to move"),
        (lambda: design_axes(plans(), duration=10, fs=FS, method="luck"), "method = 'luck'"),
        (lambda: AxisPlan(axis="", limits=LIMITS, band=(1, 2)), "names no axis"),
        (lambda: design_axes(plans(band=(1, 150)), duration=10, fs=FS), "Nyquist"),
        (lambda: input_condition(np.ones((2, 50)), band=(1, 2)), "fs is not given"),
        (lambda: input_condition(np.ones((2, 50)), fs=FS, band=(1, 2)), "does not move"),
        (
            lambda: input_condition(
                np.random.default_rng(0).standard_normal((2, 50)), fs=FS, band=(1, 2)
            ),
            "narrower than 12 bins",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises((ArgumentError, LimitsError), match=message):
        make()


def test_arrays_of_a_plain_sweep_and_its_reverse_as_published():
    """One chirp reversed in time tells two axes apart over its whole band but the middle."""
    sweep = Sweep(band=(0.1, 20.0), duration=10.0, extinction=0.0)
    up = sweep.motion(np.arange(2000) / FS).position
    found = input_condition([up, up[::-1]], fs=FS, band=(1.0, 19.0))
    assert found.share == 1.0
    worst = found.frequency[int(np.argmax(found.condition))]
    assert 8.0 < worst < 12.0  # where the two cross, at 10 Hz
