"""Designed stimuli: the paper's figures, the limits, rest at both ends, refusals."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus import (
    Limits,
    RestToRest,
    Step,
    Stimulus,
    SumOfSines,
    Sweep,
    design,
    rest_to_rest,
    true_peaks,
)
from hmpim.stimulus.inside import check_inside as looked_at_by_a_rig
from hmpim.stimulus.solve import sweep_peaks
from tests_support import designed_once, examples

FIG_12 = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
FIG_13 = Limits(position=10, velocity=500, acceleration=40000, unit="deg")


def windowed_level(stimulus, frequency):
    """20 log10 |DFT| at `frequency`, Gaussian window of eq. (15) with alpha = 1.5."""
    N = stimulus.samples
    window = np.exp(-0.5 * (1.5 * (np.arange(N) - N / 2) / (N / 2)) ** 2)
    kernel = np.exp(-2j * math.pi * frequency * stimulus.time)
    return 20 * math.log10(abs(np.sum(window * stimulus.position * kernel)))


def sigma_2(stimulus, t):
    sweep = stimulus.core
    return sweep.start_omega + sweep.sweep_rate * t**sweep.extinction / 2


@pytest.mark.parametrize("lead", ["auto", 0])
def test_figure_12_needs_no_extinction(lead):
    stimulus = design(band=(0.1, 10), duration=10, fs=500, limits=FIG_12, lead=lead)
    assert stimulus.extinction == 0.0
    assert stimulus.peaks.position == pytest.approx(10.0, rel=1e-8)
    assert stimulus.peaks.velocity == pytest.approx(20 * math.pi * 10.0, rel=1e-3)
    assert stimulus.peaks.acceleration == pytest.approx(39400, rel=5e-3)


@pytest.mark.parametrize(("duration", "level"), [(5.0, 50.6), (10.0, 53.0)])
def test_figure_12_level_at_10_hz(duration, level):
    stimulus = design(band=(0.1, 10), duration=duration, fs=500, limits=FIG_12, lead=0)
    assert windowed_level(stimulus, 10.0) == pytest.approx(level, abs=0.1)


@pytest.mark.parametrize(("duration", "n"), [(10.0, 0.83), (12.0, 0.81)])
@pytest.mark.parametrize("lead", ["auto", 0])
def test_figure_13_extinction_and_amplitude(duration, n, lead):
    stimulus = design(band=(0.1, 40), duration=duration, fs=500, limits=FIG_13, lead=lead)
    assert stimulus.extinction == pytest.approx(n, abs=0.005)
    assert stimulus.gain / sigma_2(stimulus, duration) == pytest.approx(0.6, abs=0.1)  # "~1 deg"
    assert stimulus.peaks.acceleration == pytest.approx(40000, rel=0.005)


def test_figure_13_level_at_40_hz_and_twice_the_rate():
    slow = designed_once(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, lead=0)
    fast = design(band=(0.1, 40), duration=10, fs=1000, limits=FIG_13, lead=0)
    assert windowed_level(slow, 40.0) == pytest.approx(23.0, abs=0.5)
    twice = windowed_level(fast, 40.0) - windowed_level(slow, 40.0)
    assert twice == pytest.approx(20 * math.log10(2), abs=0.1)


def test_sampled_at_fs_from_the_closed_form():
    stimulus = designed_once(band=(0.1, 20), duration=10, fs=200, limits=FIG_12, lead=0)
    assert stimulus.samples == 2000
    assert stimulus.duration == 10.0
    assert stimulus.time == pytest.approx(np.arange(2000) / 200.0, abs=1e-15)
    sweep = Sweep(band=(0.1, 20), duration=10, gain=stimulus.gain, extinction=stimulus.extinction)
    assert np.array_equal(stimulus.velocity, sweep.motion(stimulus.time).velocity)
    with pytest.raises(ValueError, match="read-only"):
        stimulus.position[0] = 1.0


def test_units_scale_the_motion_and_nothing_else():
    deg = designed_once(band=(0.1, 40), duration=10, fs=500, limits=FIG_13)
    rad = design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13.to("rad"))
    assert rad.unit == "rad"
    assert rad.extinction == deg.extinction
    assert np.rad2deg(rad.position) == pytest.approx(deg.position, abs=1e-7)


def test_same_wish_same_samples():
    one, two = (design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13) for _ in range(2))
    assert one.acceleration.tobytes() == two.acceleration.tobytes()
    assert one.gain == two.gain


@st.composite
def wishes(draw):
    """Bands of 0.02 to 2.5 decades and limits from loose to severe."""
    first = draw(st.floats(0.02, 5.0))
    band = (first, first * 10 ** draw(st.floats(0.02, 2.3)))
    cycles = draw(st.floats(1.0, 60.0))
    position = 10 ** draw(st.floats(-2.0, 2.0))
    omega = 2 * math.pi * band[1]
    return {
        "band": band,
        "duration": 2 * cycles / (band[0] + band[1]),
        "fs": band[1] * draw(st.floats(2.05, 20.0)),
        "limits": Limits(
            position=position,
            velocity=position * omega * 10 ** draw(st.floats(-0.9, 0.3)),
            acceleration=position * omega**2 * 10 ** draw(st.floats(-1.5, 0.3)),
        ),
    }


def designed(wish, **more):
    """The stimulus; a wish too tight is passed over, that no lead fits is a failure."""
    try:
        return design(**wish, **more)
    except LimitsError as error:
        if "limits are too tight" not in str(error):
            raise
    return assume(False)


def of_sweep(stimulus, lead):
    return sweep_peaks(stimulus.core, start=1 / stimulus.fs if lead == 0 else None)


def oversampled(stimulus, times=16):
    return np.arange(stimulus.samples * times + 1) / (times * stimulus.fs)


def check_inside(stimulus, t):
    at = stimulus.motion(t)
    for name in ("position", "velocity", "acceleration"):
        peak = np.abs(getattr(at, name)).max()
        assert peak <= getattr(stimulus.limits, name)
        assert peak <= getattr(stimulus.peaks, name) * (1 + 1e-9)


@examples(3)
@given(wish=wishes())
def test_led_stimulus_is_at_rest_at_both_ends_and_inside_its_limits(wish):
    stimulus = designed(wish)
    check_inside(stimulus, oversampled(stimulus))
    for name in ("position", "velocity", "acceleration"):
        samples = getattr(stimulus, name)
        assert samples[0] == 0.0
        assert samples[-1] == 0.0
    assert stimulus.tail == max(0.5, 2 / stimulus.fs)
    settled = stimulus.time >= stimulus.duration - stimulus.tail
    assert not stimulus.position[settled].any()


@examples(6)
@given(wish=wishes(), n=st.one_of(st.just(0.0), st.floats(0.0, 2.5)))
def test_stated_extinction_is_taken_and_one_limit_is_reached(wish, n):
    stimulus = designed(wish, extinction=n)
    assert stimulus.extinction == n
    check_inside(stimulus, oversampled(stimulus))
    # of the sweep itself: a lead may leave it just before its last peak
    assert stimulus.limits.use(of_sweep(stimulus, "auto")) == pytest.approx(1.0, abs=1e-7)


@examples(4)
@given(wish=wishes(), lead=st.sampled_from(["auto", 0]))
def test_extinction_is_the_smallest_and_gain_the_largest(wish, lead):
    stimulus = designed(wish, lead=lead)
    reached = of_sweep(stimulus, lead).position
    assert reached == pytest.approx(stimulus.limits.position, rel=1e-7)
    n = stimulus.extinction
    assert round(n * 1000) == pytest.approx(n * 1000, abs=1e-6)
    if n >= 0.001:
        less = design(**wish, lead=lead, extinction=n - 0.001)
        assert of_sweep(less, lead).position < stimulus.limits.position * (1 - 1e-8)


@examples(6)
@given(wish=wishes())
def test_printed_waveform_keeps_its_samples_inside(wish):
    stimulus = designed(wish, lead=0)
    assert stimulus.duration == stimulus.sweep_duration
    t = oversampled(stimulus)
    singular = 0.0 < stimulus.extinction < 1.0
    check_inside(stimulus, t[(t == 0.0) | (t >= 1.0 / stimulus.fs)] if singular else t)


@examples(6)
@given(wish=wishes(), n=st.one_of(st.just("auto"), st.floats(0.0, 2.0)))
def test_led_derivatives_agree_and_pieces_meet(wish, n):
    stimulus = designed(wish, extinction=n)
    led = stimulus.waveform
    assert isinstance(led, RestToRest)
    peaks = stimulus.peaks
    assert len(led.breaks) >= 4  # a lead and a run-out, each with both its ends
    for at in led.breaks:
        # no jump: from one side to the other only what slope and instant allow
        step = 1e-7 * peaks.velocity / peaks.acceleration
        before, after = (led.motion(np.array([at - step, at + step])) for _ in range(2))
        assert abs(np.diff(before.position)[0]) <= 2.1 * step * peaks.velocity
        assert abs(np.diff(after.velocity)[0]) <= 2.1 * step * peaks.acceleration
        assert abs(np.diff(before.acceleration)[0]) <= 1e-4 * peaks.acceleration
    # slopes by differences of fourth order, away from the joints, where the third derivative jumps
    h = 2e-4 / stimulus.band[1]
    t = np.random.default_rng(1).uniform(0.0, stimulus.duration, 400)
    near = np.abs(t[:, None] - np.array(led.breaks)).min(axis=1) < 3 * h
    early = np.abs(t - led.sweep_start - led.join) < 200 * h  # where an extinguished sweep bends
    t = t[~near & ~early]
    here = led.motion(t)
    ahead, behind = led.motion(t + h), led.motion(t - h)
    ahead2, behind2 = led.motion(t + 2 * h), led.motion(t - 2 * h)
    for values, slope in (("position", "velocity"), ("velocity", "acceleration")):
        near_, far = (
            getattr(b, values) - getattr(a, values) for a, b in ((behind, ahead), (behind2, ahead2))
        )
        numerical = (8 * near_ - far) / (12 * h)
        size = getattr(peaks, slope)
        rounding = 1e-14 * getattr(peaks, values) / h * stimulus.core.cycles
        assert np.abs(numerical - getattr(here, slope)).max() < 1e-7 * size + rounding


@examples(6)
@given(
    frequency=st.floats(0.2, 5.0),
    ratio=st.floats(1.2, 6.0),
    phases=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    cycles=st.floats(2.0, 20.0),
)
def test_any_waveform_with_a_band_can_be_led(frequency, ratio, phases, cycles):
    core = SumOfSines(
        amplitudes=(1.0, 0.5),
        frequencies=(frequency, ratio * frequency),
        phases=phases,
        duration=cycles / frequency,
    )
    peaks = true_peaks(core)
    limits = Limits(
        position=peaks.position, velocity=peaks.velocity, acceleration=peaks.acceleration
    )
    fs = 50.0 * frequency
    led = Stimulus(waveform=rest_to_rest(core, limits=limits, fs=fs), fs=fs, limits=limits)
    assert led.position[0] == led.velocity[0] == led.acceleration[0] == 0.0
    assert led.position[-1] == led.velocity[-1] == led.acceleration[-1] == 0.0
    middle = np.array([0.5 * core.duration])
    shifted = led.motion(middle + led.sweep_start).velocity
    assert shifted == pytest.approx(core.motion(middle).velocity, abs=1e-9 * peaks.velocity)
    at = led.motion(oversampled(led))
    assert np.abs(at.velocity).max() <= peaks.velocity * (1 + 1e-9)


def test_a_step_cannot_be_led():
    with pytest.raises(ArgumentError, match="a Step jumps within itself"):
        rest_to_rest(Step(duration=1.0), limits=Limits(position=2.0), fs=100.0)


def test_lead_removes_the_singular_start():
    printed = design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, extinction=0.3, lead=0)
    led = design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, extinction=0.3)
    first_cycle = led.sweep_start + led.core.time_of_phase(2.5 * math.pi)
    t = np.linspace(0.0, first_cycle, 200_001)
    start = np.abs(led.motion(t).acceleration).max()
    # the printed one has no bound as t falls
    tiny = np.abs(printed.motion(np.array([1e-6, 1e-9, 1e-12])).acceleration)
    assert tiny[1] > 100 * tiny[0]
    assert tiny[2] > 100 * tiny[1] > 100 * FIG_13.acceleration
    calm = np.abs(led.core.motion(np.linspace(0.2, 1.0, 2001)).acceleration).max()
    assert start <= 2.0 * calm


def test_sweep_inside_the_leads_is_the_printed_one():
    printed = designed_once(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, lead=0)
    led = designed_once(band=(0.1, 40), duration=10, fs=500, limits=FIG_13)
    assert led.extinction == printed.extinction
    assert led.gain == pytest.approx(printed.gain, rel=1e-9)
    first = round(led.sweep_start * led.fs)
    assert first == pytest.approx(led.sweep_start * led.fs, abs=1e-9)  # it starts on a sample
    joined = math.ceil(led.waveform.join * led.fs)
    assert joined / led.fs <= led.core.time_of_phase(0.1)  # hardly anything is replaced
    inside = led.position[first + joined : first + 5000]
    assert inside == pytest.approx(printed.position[joined:5000], abs=1e-9)
    assert led.sweep_duration == 10.0


def test_stated_lead_is_time_and_the_motion_in_it_is_as_gentle():
    auto = designed_once(band=(0.1, 40), duration=10, fs=500, limits=FIG_13)
    long = design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, lead=2.0, tail=1.0)
    assert long.sweep_start == 2.0
    assert long.duration == pytest.approx(2 + 10 + 2 + 1, abs=0.003)
    assert long.waveform.lead_in.duration == pytest.approx(auto.waveform.lead_in.duration)
    short = design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, lead=0.05)
    assert short.sweep_start == 0.05
    assert short.limits.use(short.peaks) <= 1.0


def test_too_short_a_lead_is_refused_with_one_that_does():
    with pytest.raises(LimitsError, match=r"lead = 0.0001 s is too short") as refusal:
        design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, lead=0.0001)
    enough = float(re.search(r"lead = ([\d.]+) s is enough", str(refusal.value))[1])
    fits = design(band=(0.1, 40), duration=10, fs=500, limits=FIG_13, lead=enough)
    assert fits.limits.use(fits.peaks) <= 1.0


def reached(stimulus, lead):
    """Largest position, of the sweep or of the lead into it."""
    return max(of_sweep(stimulus, lead).position, stimulus.peaks.position)


@examples(3)
@given(wish=wishes(), tight=st.floats(-3.0, -1.5), lead=st.sampled_from(["auto", 0]))
def test_too_tight_limits_are_refused_with_numbers_that_do(wish, tight, lead):
    wish["limits"] = replace(wish["limits"], velocity=wish["limits"].velocity * 10**tight)
    try:
        design(**wish, lead=lead)
    except LimitsError as error:
        said = str(error)
    else:
        assume(False)
    number = r"(\d[\d.e+-]*)"
    lower = float(re.search(f"lower the position limit to {number}", said)[1])
    smaller = design(**{**wish, "limits": replace(wish["limits"], position=lower)}, lead=lead)
    assert reached(smaller, lead) == pytest.approx(lower, rel=1e-7)
    raised = wish["limits"]
    if found := re.search(rf"{number} units/s \(the limit", said):
        raised = replace(raised, velocity=float(found[1]))
    if found := re.search(rf"{number} units/s² \(the limit", said):
        raised = replace(raised, acceleration=float(found[1]))
    allowed = design(**{**wish, "limits": raised}, lead=lead)
    assert reached(allowed, lead) == pytest.approx(raised.position, rel=1e-7)


def test_without_a_position_limit_the_others_scale_it():
    stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=Limits(acceleration=1000.0))
    assert stimulus.extinction == 0.0
    assert stimulus.peaks.acceleration == pytest.approx(1000.0, rel=1e-7)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"band": (0.1, 120.0)}, "sample faster than 240 Hz, or end the band below 100 Hz"),
        ({"band": (0.1, 100.0)}, "reaches the Nyquist frequency 100 Hz"),
        ({"band": (20.0, 0.1)}, "does not rise"),
        ({"band": (-0.1, 20.0)}, "start of the band = -0.1 Hz"),
        ({"band": (0.1, math.nan)}, "end of the band = nan Hz"),
        ({"duration": -10.0}, "duration = -10.0 s"),
        ({"duration": 0.05}, "makes 0.503 cycles in 0.05 s, .* a duration of 0.0996 s is enough"),
        ({"fs": 0.0}, "fs = 0.0 Hz"),
        ({"fs": math.nan}, "fs = nan Hz"),
        ({"limits": Limits()}, "no limit is finite"),
        ({"limits": None}, "limits = None is not Limits; make them with hmpim.Limits"),
        ({"extinction": -1.0}, "extinction = -1.0 must lie"),
        ({"extinction": "much"}, "extinction = 'much' is not a number or 'auto'"),
        ({"lead": -1.0}, "lead = -1.0 must be 'auto', 0 or a positive time"),
        ({"lead": "long"}, "lead = 'long' is not a number or 'auto'"),
        ({"lead": math.nan}, "lead = nan must be"),
        ({"tail": -1.0}, "tail = -1.0 must be"),
    ],
)
def test_refusals(wrong, message):
    right = {"band": (0.1, 20.0), "duration": 10.0, "fs": 200.0, "limits": FIG_12}
    with pytest.raises(ArgumentError, match=message):
        design(**{**right, **wrong})


def test_stimulus_beyond_its_limits_is_refused_with_the_factor():
    sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=37.385 * 2)
    with pytest.raises(LimitsError, match=r"peak position 20.* scale the waveform by 0.4999 "):
        Stimulus(waveform=sweep, fs=500.0, unit="deg", limits=Limits(position=10.0, unit="deg"))


@examples(30)
@given(wish=wishes(), n=st.floats(0.0, 2.5), start=st.floats(0.01, 0.5))
def test_true_peaks_are_no_less_and_hardly_more_than_a_dense_scan(wish, n, start):
    sweep = Sweep(band=wish["band"], duration=wish["duration"], extinction=n)
    begin = start * sweep.duration
    peaks = true_peaks(sweep, start=begin)
    count = int(400 * sweep.cycles) + 4001
    at = sweep.motion(np.linspace(begin, sweep.duration, count))
    for name in ("position", "velocity", "acceleration"):
        scanned = np.abs(getattr(at, name)).max()
        assert scanned * (1 - 1e-10) <= getattr(peaks, name) <= scanned * (1 + 1e-3)


@pytest.mark.parametrize("duration", [10.0, 10.00001, 10.0001, 10.0019])
def test_a_printed_sweep_run_backwards_keeps_its_limits_up_to_its_last_sample(duration):
    """Its singular instant is the end, and a sample may lie just before that."""
    limits = Limits(position=10, velocity=1000, acceleration=40000)
    stimulus = design(
        band=(0.1, 10), duration=duration, fs=500, limits=limits,
        kind="reversed", extinction=0.3, lead=0,
    )  # fmt: skip
    peak = np.abs(stimulus.acceleration).max()
    assert peak <= min(stimulus.peaks.acceleration, limits.acceleration) * (1 + 1e-9)


@pytest.mark.parametrize(
    ("limits", "wish"),
    [
        (
            Limits(position=27893.960102756308, acceleration=17.860866510314835),
            {
                "band": (0.005656823398254191, 0.7754450143481508),
                "duration": 133.308340627076,
                "fs": 387.7225071740754,
                "kind": "steps",
                "lead": 1094.5789405530497,
            },
        ),
        (
            Limits(acceleration=19.0260721943255),
            {
                "band": (47.108348004686775, 2442.7722397052985),
                "duration": 0.09490607474966888,
                "fs": 1221386.1198526493,
                "kind": "exponential",
                "extinction": 2.0,
            },
        ),
    ],
)
def test_rounding_of_a_small_motion_sampled_fast_is_not_taken_for_an_excess(limits, wish):
    looked_at_by_a_rig(design(limits=limits, **wish), limits, whose="yaw")
