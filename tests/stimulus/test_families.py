"""Each family of waveforms: closed forms, derivatives, peaks, spectra, scale, refusals."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import max_len_seq

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus import (
    ExponentialSweep,
    Limits,
    Multisine,
    Prbs,
    Quintic,
    Ramp,
    RestToRest,
    Reversed,
    Step,
    Steps,
    Stimulus,
    Sweep,
    interleaved_multisines,
    random_phase_multisine,
    rest_to_rest,
    scale_to_limits,
    schroeder_multisine,
    smooth_prbs,
    smooth_steps,
    true_peaks,
)
from hmpim.stimulus.limits import QUANTITIES
from tests_support import examples

LIMITS = Limits(position=10, velocity=500, acceleration=8000, jerk=6e5)


def slope(function, t, h):
    """Differences of fourth order."""
    return (8 * (function(t + h) - function(t - h)) - function(t + 2 * h) + function(t - 2 * h)) / (
        12 * h
    )


@pytest.mark.parametrize(
    "waveform",
    [
        Sweep(band=(0.3, 6.0), duration=4.0, gain=2.0, extinction=0.0),
        Sweep(band=(0.3, 6.0), duration=4.0, gain=2.0, extinction=0.7),
        Sweep(band=(0.3, 6.0), duration=4.0, gain=2.0, extinction=2.4),
        ExponentialSweep(band=(0.3, 6.0), duration=4.0, gain=2.0, extinction=0.0),
        ExponentialSweep(band=(0.3, 6.0), duration=4.0, gain=2.0, extinction=1.3),
        Reversed(waveform=ExponentialSweep(band=(0.3, 6.0), duration=4.0, extinction=0.5)),
        Multisine(
            frequencies=(0.5, 1.75, 6.0), amplitudes=(1, 0.0, 0.2), phases=(0, 1, 2), duration=4.0
        ),
        schroeder_multisine(band=(0.5, 6.0), duration=4.0, limits=Limits(position=1.0)),
        Steps(levels=(1.0, -2.0, 0.0), hold=1.5, rise=1.0),
        Prbs(amplitude=2.0, order=3, bit=0.5, bits=7, rise=0.5),
        Quintic(start=0.0, duration=4.0, coefficients=(0.0, 1.0, -2.0, 3.0, 1.0, -1.0)),
    ],
    ids=lambda waveform: type(waveform).__name__,
)
def test_each_derivative_is_that_of_the_one_before(waveform):
    h = 1e-3
    t = np.linspace(0.21, 3.77, 391)
    breaks = np.array((-1.0, *getattr(waveform, "breaks", ())))
    t = t[np.abs(t[:, None] - breaks).min(axis=1) > 3 * h]  # the jerk jumps there
    for lower, higher in pairwise(QUANTITIES):
        expected = slope(lambda s, name=lower: getattr(waveform.motion(s), name), t, h)
        found = getattr(waveform.motion(t), higher)
        assert np.abs(found - expected).max() < 3e-7 * np.abs(found).max(), higher


@given(
    low=st.floats(0.05, 5.0),
    ratio=st.floats(1.1, 200.0),
    T=st.floats(0.5, 20.0),
    n=st.floats(0.0, 3.0),
    share=st.floats(0.0, 1.0),
)
@examples(16)
def test_exponential_sweep_is_the_textbook_one(low, ratio, T, n, share):
    sweep = ExponentialSweep(band=(low, ratio * low), duration=T, gain=3.0, extinction=n)
    t = np.array([share * T])
    frequency = low * ratio ** (t / T)
    phase = 2 * math.pi * low * T / math.log(ratio) * (ratio ** (t / T) - 1)
    expected = 3.0 * (frequency / low) ** -n * np.sin(phase)
    assert sweep.motion(t).position == pytest.approx(expected, abs=1e-9 * (1 + phase[0]))


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0, 3.0])
def test_extinction_of_an_exponential_sweep_holds_the_nth_derivative_level(n):
    sweep = ExponentialSweep(band=(2.0, 40.0), duration=30.0, extinction=n)
    name = QUANTITIES[int(n)]
    early, late = (getattr(true_peaks(sweep, start=a, stop=a + 3), name) for a in (0.0, 27.0))
    assert late == pytest.approx(early, rel=0.02)


def test_jerk_of_the_sweep_at_time_zero():
    for n in (0.0, 1.0, 2.0, 2.7, 3.5):
        sweep = Sweep(band=(0.5, 5.0), duration=3.0, extinction=n)
        start, just_after = sweep.motion(np.array([0.0, 1e-9])).jerk
        if n not in (2.7,):
            assert start == pytest.approx(just_after, rel=1e-3), n


@given(t=st.floats(-1.0, 6.0))
def test_reversed_is_mirrored_and_twice_reversed_the_same(t):
    sweep = Sweep(band=(0.3, 6.0), duration=4.0, extinction=0.5)
    at = np.array([t])
    back = Reversed(waveform=sweep)
    assert back.motion(at).position == sweep.motion(4.0 - at).position
    assert back.motion(at).jerk == -sweep.motion(4.0 - at).jerk
    twice = Reversed(waveform=back).motion(4.0 - at)
    assert twice.acceleration == sweep.motion(4.0 - (4.0 - (4.0 - at))).acceleration
    assert back.band == sweep.band


def test_lead_of_a_reversed_sweep_is_the_mirror_of_its_own():
    sweep = scale_to_limits(Sweep(band=(0.3, 6.0), duration=4.0), LIMITS)
    forth = rest_to_rest(sweep, limits=LIMITS, fs=100.0)
    back = rest_to_rest(Reversed(waveform=sweep), limits=LIMITS, fs=100.0)
    s = np.linspace(-1.0, 5.0, 777)
    mirrored = back.motion(back.sweep_start + 4.0 - s)
    plain = forth.motion(forth.sweep_start + s)
    assert np.abs(mirrored.position - plain.position).max() < 1e-9
    assert np.abs(mirrored.velocity + plain.velocity).max() < 1e-8
    assert back.sweep_start * 100.0 == pytest.approx(round(back.sweep_start * 100.0), abs=1e-9)


def dft(multisine, samples=1000):
    fs = samples / multisine.duration
    x = multisine.motion(np.arange(samples) / fs).position
    return np.fft.rfftfreq(samples, 1 / fs), 2 * np.fft.rfft(x) / samples


@pytest.mark.parametrize("kind", ["schroeder", "random"])
def test_multisine_has_its_lines_and_nothing_between(kind):
    wish = {"band": (0.5, 12.0), "duration": 10.0, "limits": LIMITS}
    made = (
        schroeder_multisine(**wish)
        if kind == "schroeder"
        else random_phase_multisine(**wish, rng=7)
    )
    frequency, spectrum = dft(made)
    lines = np.round(np.array(made.frequencies) * 10).astype(int)
    assert lines.tolist() == list(range(5, 121))
    expected = np.zeros(spectrum.size, dtype=complex)
    expected[lines] = made.amplitudes * np.exp(1j * np.array(made.phases))
    assert np.abs(spectrum - expected).max() < 1e-10
    # shaped as the largest single sine of each frequency, up to one scale
    omega = 2 * np.pi * frequency[lines]
    shape = np.min([10 + 0 * omega, 500 / omega, 8000 / omega**2, 6e5 / omega**3], axis=0)
    assert np.ptp(made.amplitudes / shape) < 1e-9
    assert LIMITS.use(true_peaks(made)) == pytest.approx(1.0, abs=1e-7)


def test_schroeder_phases_keep_the_crest_factor_low():
    flat = Limits(position=1.0)
    schroeder = schroeder_multisine(band=(1.0, 20.0), duration=10.0, limits=flat)
    drawn = random_phase_multisine(band=(1.0, 20.0), duration=10.0, limits=flat, rng=1)
    in_phase = Multisine(
        frequencies=schroeder.frequencies,
        amplitudes=schroeder.amplitudes,
        phases=(0.0,) * len(schroeder.frequencies),
        duration=10.0,
    )

    def crest(waveform):
        rms = math.sqrt(sum(A * A for A in waveform.amplitudes) / 2)
        return true_peaks(waveform).position / rms

    assert crest(schroeder) < 2.0  # about 1.7 for many lines; a single sine has 1.41
    assert crest(schroeder) < 0.75 * crest(drawn)
    assert crest(in_phase) == pytest.approx(math.sqrt(2 * len(in_phase.frequencies)), rel=1e-6)


@pytest.mark.parametrize("phases", ["schroeder", "random"])
def test_interleaved_multisines_are_orthogonal_and_fill_the_band(phases):
    axes = interleaved_multisines(
        bands=[(0.5, 12.0), (0.5, 12.0), (0.5, 6.0)],
        limits=[LIMITS, Limits(position=1.0), LIMITS],
        duration=10.0,
        phases=phases,
        rng=3,
    )
    numbers = [set(np.round(np.array(axis.frequencies) * 10).astype(int)) for axis in axes]
    assert numbers[0] | numbers[1] | numbers[2] >= set(range(5, 61))
    t = np.arange(1000) / 100.0
    x = np.array([axis.motion(t).velocity for axis in axes])
    gram = x @ x.T
    assert np.abs(gram - np.diag(np.diag(gram))).max() < 1e-9 * gram.max()


def test_lines_evenly_spaced_or_not_are_the_same_sum():
    even = random_phase_multisine(band=(0.5, 40.0), duration=20.0, limits=LIMITS, rng=2)
    t = np.random.default_rng(1).uniform(0, 20, 300)
    omega = 2 * np.pi * np.array(even.frequencies)
    angle = np.outer(t, omega) + np.array(even.phases)
    expected = (np.array(even.amplitudes) * omega**3 * np.sin(angle)).sum(axis=1)
    assert even.motion(t).jerk == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


@given(
    distance=st.floats(0.1, 50.0),
    v=st.floats(1.0, 1e3),
    a=st.floats(1.0, 1e5),
    j=st.floats(10.0, 1e7),
)
@examples(16)
def test_peaks_of_a_transition_are_the_closed_forms(distance, v, a, j):
    limits = Limits(velocity=v, acceleration=a, jerk=j)
    from hmpim.stimulus.profile import shortest_rise

    rise = shortest_rise(distance, limits)
    peaks = true_peaks(Steps(levels=(distance, 0.0), hold=2 * rise, rise=rise))
    assert peaks.position == pytest.approx(distance, rel=1e-12)
    assert peaks.velocity == pytest.approx(15 / 8 * distance / rise, rel=1e-8)
    assert peaks.acceleration == pytest.approx(10 / math.sqrt(3) * distance / rise**2, rel=1e-8)
    assert peaks.jerk == pytest.approx(60 * distance / rise**3, rel=1e-8)
    assert limits.use(peaks) == pytest.approx(1.0, rel=1e-7)


def test_prbs_plays_a_maximum_length_sequence_with_a_flat_spectrum():
    prbs = Prbs(amplitude=1.0, order=7, bit=0.1, bits=254, rise=0.02)
    settled = prbs.motion((np.arange(254) + 0.5) * 0.1).position
    assert np.array_equal(settled[:127], settled[127:])  # one period, and again
    assert np.array_equal(settled[:127], 2.0 * max_len_seq(7)[0] - 1.0)
    power = np.abs(np.fft.rfft(settled[:127])[1:]) ** 2
    assert power == pytest.approx(np.full(63, 128.0), rel=1e-9)
    ends = prbs.motion(np.array([0.0, prbs.duration, prbs.duration + 1.0]))
    assert not np.any([getattr(ends, name) for name in QUANTITIES])


def test_smooth_prbs_and_steps_reach_the_amplitude_then_a_derivative():
    wish = {"band": (0.1, 3.0), "duration": 20.0, "fs": 500.0, "limits": LIMITS}
    for waveform in (smooth_prbs(**wish), smooth_steps(**wish)):
        peaks = true_peaks(waveform)
        assert peaks.position == pytest.approx(10.0, rel=1e-6)
        assert waveform.duration <= 20.0
    prbs = smooth_prbs(**wish)
    assert max(peaks_share(prbs)[1:]) == pytest.approx(1.0, rel=1e-6)  # no rise is shorter
    assert prbs.bit == pytest.approx(0.146)
    tight = smooth_prbs(**{**wish, "limits": Limits(position=10, velocity=1.0)})
    assert tight.rise == tight.bit
    assert true_peaks(tight).velocity == pytest.approx(1.0, rel=1e-6)
    assert tight.amplitude < 1.0


def peaks_share(waveform):
    peaks = true_peaks(waveform)
    return [getattr(peaks, name) / getattr(LIMITS, name) for name in QUANTITIES]


@pytest.mark.parametrize(
    "waveform",
    [
        Sweep(band=(0.3, 6.0), duration=4.0, extinction=2.0),
        ExponentialSweep(band=(0.3, 6.0), duration=4.0),
        Reversed(waveform=Sweep(band=(0.3, 6.0), duration=4.0)),
        Multisine(frequencies=(1.0, 2.0), amplitudes=(1, 1), phases=(0, 1), duration=3.0),
        Prbs(order=4, bit=0.5, bits=15, rise=0.2),
        Steps(levels=(1.0, 0.0), hold=1.0, rise=0.3),
        rest_to_rest(Sweep(band=(0.3, 6.0), duration=4.0), limits=Limits(position=9.0), fs=50.0),
    ],
    ids=lambda waveform: type(waveform).__name__,
)
@pytest.mark.parametrize("binding", QUANTITIES)
def test_scale_reaches_whichever_limit_binds(waveform, binding):
    generous = {name: 1e9 * getattr(LIMITS, name) for name in QUANTITIES}
    limits = Limits(**{**generous, binding: 0.37})
    scaled = scale_to_limits(waveform, limits)
    assert type(scaled) is type(waveform)
    assert getattr(true_peaks(scaled), binding) == pytest.approx(0.37, rel=1e-7)
    assert limits.use(true_peaks(scaled)) <= 1.0


def test_jumps_are_infinite_and_refused():
    step = Step(duration=1.0, start=0.3)
    peaks = true_peaks(step)
    assert peaks.position == 1.0
    assert peaks.velocity == peaks.acceleration == peaks.jerk == math.inf
    ramp = true_peaks(Ramp(rate=2.0, duration=1.0, start=0.3))
    assert (ramp.velocity, ramp.acceleration) == (2.0, math.inf)
    assert math.isfinite(true_peaks(Steps(levels=(1.0, 0.0), hold=1.0, rise=1.0)).jerk)
    Stimulus(waveform=step, fs=100.0)
    Stimulus(waveform=step, fs=100.0, limits=Limits(position=1.0))
    for start in (0.0, 0.3):
        with pytest.raises(LimitsError, match="peak velocity is infinite, for the waveform jumps"):
            Stimulus(
                waveform=Step(duration=1.0, start=start), fs=100.0, limits=Limits(velocity=1e9)
            )
    with pytest.raises(LimitsError, match="a Step jumps, so that no scale of it keeps"):
        scale_to_limits(step, Limits(velocity=1.0))
    assert Stimulus(waveform=step, fs=100.0).peaks.velocity == pytest.approx(100.0)


class WithoutJerk:
    """Anyone's waveform, which gives no jerk."""

    duration = 2.0
    band = (1.0, 1.0)

    def motion(self, time):
        at = Multisine(frequencies=(1.0,), amplitudes=(1,), phases=(-math.pi / 2,), duration=2.0)
        moved = at.motion(time)
        return type(moved)(
            time=time,
            position=moved.position,
            velocity=moved.velocity,
            acceleration=moved.acceleration,
        )


def test_a_jerk_that_is_not_known_keeps_no_jerk_limit():
    assert true_peaks(WithoutJerk()).jerk == math.inf
    Stimulus(waveform=WithoutJerk(), fs=50.0, limits=Limits(acceleration=40.0))
    led = rest_to_rest(WithoutJerk(), limits=Limits(acceleration=40.0), fs=50.0)
    assert isinstance(led, RestToRest)
    assert led.motion(np.zeros(1)).jerk is None
    with pytest.raises(LimitsError, match="jerk"):
        Stimulus(waveform=led, fs=50.0, limits=Limits(jerk=1e12))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ExponentialSweep(band=(1, 2), duration=1, extinction=-1), "extinction = -1 must"),
        (lambda: ExponentialSweep(band=(2, 1), duration=1), "does not rise"),
        (lambda: ExponentialSweep(band=(1, 2), duration=1, gain=math.nan), "gain = nan"),
        (
            lambda: Multisine(frequencies=(1, 2), amplitudes=(1,), phases=(0, 0), duration=1),
            "2 frequencies, 1 amplitudes and 2 phases",
        ),
        (
            lambda: Multisine(frequencies=(2, 1), amplitudes=(1, 1), phases=(0, 0), duration=1),
            "must be positive and rise",
        ),
        (
            lambda: Multisine(frequencies=(1,), amplitudes=(-1,), phases=(0,), duration=1),
            "must not be negative",
        ),
        (
            lambda: Multisine(frequencies=(1,), amplitudes=(1,), phases=(math.nan,), duration=1),
            "must be finite",
        ),
        (lambda: Steps(levels=(1.0,), hold=1.0, rise=0.5), "the last level, 1.0, must be 0"),
        (lambda: Steps(levels=(1.0, 0.0), hold=1.0, rise=1.5), "does not fit into hold"),
        (lambda: Steps(levels=(0.0,), hold=1.0, rise=0.5), "go nowhere"),
        (lambda: Prbs(order=1, bit=1, bits=3, rise=0.5), "order = 1 must be a whole number"),
        (lambda: Prbs(order=3, bit=1, bits=0, rise=0.5), "bits = 0 must be"),
        (lambda: Prbs(order=3, bit=1, bits=3, rise=1.5), "does not fit into a bit"),
        (
            lambda: smooth_prbs(band=(0.1, 1), duration=1, fs=100, limits=LIMITS),
            "too short for bits of 0.44 s; take 1.32 s",
        ),
        (
            lambda: schroeder_multisine(band=(1.01, 1.09), duration=10, limits=LIMITS),
            "holds no line of a multisine",
        ),
        (
            lambda: interleaved_multisines(bands=[(1, 2)], limits=[], duration=1),
            "1 bands and 0 limits",
        ),
        (
            lambda: interleaved_multisines(
                bands=[(1, 2)], limits=[LIMITS], duration=10, phases="random"
            ),
            "need a source",
        ),
        (lambda: scale_to_limits(Step(duration=1.0), Limits()), "no limit is finite"),
        (lambda: scale_to_limits(WithoutJerk(), LIMITS), "a WithoutJerk has no scale"),
    ],
)
def test_refusals(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
