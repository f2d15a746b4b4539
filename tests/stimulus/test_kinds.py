"""Every kind through one interface: inside its limits, from rest to rest, always the same."""

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, LimitsError
from hmpim.stimulus import (
    KINDS,
    Limits,
    OverFrequency,
    Sine,
    Step,
    Stimulus,
    blocks,
    check_spectrum,
    design,
    leave_room,
    measured_noise,
    signal_to_noise,
)
from hmpim.stimulus.limits import QUANTITIES
from tests_support import designed_once, examples, in_studies

LIMITS = Limits(position=10, velocity=500, acceleration=8000, unit="deg")
WISH = {"band": (0.2, 15.0), "duration": 8.0, "fs": 200.0, "limits": LIMITS}
SHORT = {"band": (0.5, 15.0), "duration": 2.0, "fs": 100.0, "limits": LIMITS}


@st.composite
def wishes(draw):
    """Bands of 0.1 to 2 decades, limits from loose to severe, with and without jerk."""
    first = draw(st.floats(0.05, 5.0))
    band = (first, first * 10 ** draw(st.floats(0.1, 2.0)))
    cycles = draw(st.floats(3.0, 40.0))
    position = 10 ** draw(st.floats(-2.0, 2.0))
    omega = 2 * math.pi * band[1]
    jerk = draw(st.one_of(st.none(), st.floats(-3.0, 0.3)))
    return {
        "band": band,
        "duration": 2 * cycles / (band[0] + band[1]),
        "fs": band[1] * draw(st.floats(2.05, 20.0)),
        "limits": Limits(
            position=position,
            velocity=position * omega * 10 ** draw(st.floats(-1.2, 0.3)),
            acceleration=position * omega**2 * 10 ** draw(st.floats(-2.0, 0.3)),
            jerk=math.inf if jerk is None else position * omega**3 * 10**jerk,
        ),
        "rng": draw(st.integers(0, 2**32)),
        "kind": draw(st.sampled_from(KINDS)),
    }


REFUSED = "limits are too tight|holds no line|is too short for bits|no lead-(in|out) of any"


def check(wish):
    """All that is promised of one design."""
    try:
        stimulus = design(**wish)
    except (LimitsError, ArgumentError) as error:
        if not re.search(REFUSED, str(error)):
            raise
        assume(False)
    limits = stimulus.limits
    for name in ("position", "velocity", "acceleration"):
        samples = getattr(stimulus, name)
        assert samples[0] == 0.0, name
        assert samples[-1] == 0.0, name
    settled = stimulus.motion(np.array([-1.0, stimulus.waveform.duration, 1e6]))
    for name in QUANTITIES:
        assert not getattr(settled, name).any(), name
    # never beyond a limit, 16 times oversampled, nor beyond the peaks that are stated
    t = np.arange(16 * stimulus.samples + 1) / (16 * stimulus.fs)
    at = stimulus.motion(t)
    for name in QUANTITIES:
        largest = np.abs(getattr(at, name)).max()
        assert largest <= getattr(limits, name), name
        assert largest <= getattr(stimulus.peaks, name) * (1 + 1e-9), name
    # each is the derivative of the one before: over any interval, its integral (Simpson)
    h = t[1] - t[0]
    middle = stimulus.motion(t[:-1] + 0.5 * h)
    rough = rough_intervals(stimulus, t)
    for lower, higher in pairwise(QUANTITIES):
        f = getattr(at, higher)
        integral = h / 6 * (f[:-1] + 4 * getattr(middle, higher) + f[1:])
        error = np.abs(np.diff(getattr(at, lower)) - integral)[~rough]
        peak = getattr(stimulus.peaks, higher)
        # the interval is at most 1/33 of the shortest cycle; of a transition it may be half
        assert error.max(initial=0.0) < 2e-3 * h * peak, (lower, higher)
    again = design(**wish)
    for name in QUANTITIES[:3]:
        assert getattr(again, name).tobytes() == getattr(stimulus, name).tobytes()


def rough_intervals(stimulus, t):
    """Intervals in which pieces meet, or in which a transition is not resolved."""
    core = stimulus.core
    if not hasattr(core, "rise"):
        breaks = np.array(getattr(stimulus.waveform, "breaks", ()))
        joined = np.searchsorted(t, breaks) - 1
        rough = np.zeros(t.size - 1, dtype=bool)
        rough[np.clip(joined, 0, t.size - 2)] = True
        if hasattr(stimulus.waveform, "lead_in"):  # short leads, and an extinguished sweep's start
            led = stimulus.waveform
            begin = led.sweep_start + led.join
            rough |= t[:-1] < begin + 0.2 / stimulus.band[0]
            rough |= t[1:] > led.sweep_start + led.leave - 0.2 / stimulus.band[0]
        return rough
    return np.full(t.size - 1, (t[1] - t[0]) > 0.05 * core.rise) | met(stimulus, t)


def met(stimulus, t):
    rough = np.zeros(t.size - 1, dtype=bool)
    at = np.searchsorted(t, np.array(stimulus.waveform.breaks)) - 1
    for shift in (-1, 0, 1):
        rough[np.clip(at + shift, 0, t.size - 2)] = True
    return rough


# its velocity peaks just after the lead hands over to the sweep
PEAK_BESIDE_A_BREAK = {
    "band": (1.0, 4.216965034285822),
    "duration": 14.567856886241147,
    "fs": 42.16965034285822,
    "limits": Limits(position=1.0, velocity=26.495972744314738, acceleration=70.20365716674695),
    "rng": 0,
    "kind": "exponential",
}


@examples(5)
@given(wish=wishes())
@example(wish=PEAK_BESIDE_A_BREAK)
def test_any_wish_of_any_kind(wish):
    check(wish)


@pytest.mark.parametrize("kind", KINDS)
def test_some_limit_is_reached_and_all_are_kept(kind):
    for limits in (LIMITS, replace(LIMITS, jerk=3e5)):
        stimulus = designed_once(**{**WISH, "limits": limits}, kind=kind, rng=1)
        assert 0.97 < limits.use(stimulus.peaks) <= 1.0
        if math.isfinite(limits.jerk):
            assert stimulus.peaks.jerk <= limits.jerk


@pytest.mark.parametrize("kind", KINDS)
def test_stated_lead_is_time_at_each_end(kind):
    stimulus = design(**WISH, kind=kind, rng=1, lead=1.5, tail=0.25)
    assert stimulus.sweep_start == pytest.approx(1.5)
    assert stimulus.duration == pytest.approx(3.0 + stimulus.sweep_duration + 0.25, abs=0.011)


def test_jerk_limit_costs_extinction():
    free = designed_once(**WISH)
    tight = design(**{**WISH, "limits": replace(LIMITS, jerk=1e5)})
    assert tight.peaks.jerk == pytest.approx(1e5, rel=5e-3)
    assert tight.extinction > free.extinction
    assert tight.peaks.position == pytest.approx(10.0, rel=1e-6)


def test_too_tight_a_jerk_is_refused_with_numbers_that_do():
    with pytest.raises(LimitsError, match=r"needs at least .* deg/s³ \(the limit is 10\)") as no:
        design(**{**WISH, "limits": replace(LIMITS, jerk=10.0)})
    lower = float(re.search(r"lower the position limit to (\S+) deg", str(no.value))[1])
    design(**{**WISH, "limits": replace(LIMITS, jerk=10.0, position=lower)})


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "sawtooth"}, "kind = 'sawtooth' is not one of 'hmpim', 'exponential'"),
        ({"kind": "prbs", "extinction": 0.5}, "extinction = 0.5 is for sweeps"),
        ({"kind": "random_phase"}, "needs rng"),
        ({"wanted_snr": 20.0}, "belong together"),
        ({"resolution": -1.0}, "resolution = -1.0 must be 0"),
        ({"lead": 0, "limits": Limits(position=1, jerk=1e5)}, "whose jerk is unbounded"),
    ],
)
def test_refusals(wrong, message):
    with pytest.raises(ArgumentError, match=message):
        design(**{**WISH, **wrong})


# what is really sent


@examples(5)
@given(kind=st.sampled_from(KINDS), step=st.floats(1e-7, 3e-3), extra=st.sampled_from([1, 2]))
@example(kind="hmpim", step=0.003, extra=1)
def test_rounded_commands_keep_the_limits_at_the_command_rate(kind, step, extra):
    stimulus = design(**WISH, kind=kind, rng=1, resolution=step)
    sent = stimulus.commanded()
    assert np.abs(sent.position / step - np.round(sent.position / step)).max() < 1e-6
    assert np.abs(sent.position - stimulus.position).max() <= 0.5 * step * (1 + 1e-6)
    x = np.concatenate(([0.0], sent.position))
    for order, name in enumerate(("position", "velocity", "acceleration")):
        found = np.abs(np.diff(x, order)).max() * 200.0**order
        assert found <= getattr(LIMITS, name) * (1 + 1e-9)
        assert getattr(sent.peaks, name) == pytest.approx(found, rel=1e-6, abs=1e-6)
    assert stimulus.commanded(resolution=0.0, fs=200.0 * extra).fs == 200.0 * extra


def test_commands_beyond_a_limit_after_rounding_are_refused():
    plain = designed_once(**WISH)
    plain.commanded(resolution=1e-6)
    with pytest.raises(LimitsError, match=r"rounded to 0.003 and sent at 1000 Hz, .* acceleration"):
        plain.commanded(resolution=0.003, fs=1000.0)
    waveform = Sine(amplitude=0.0199, frequency=1.0, duration=1.0)
    limits = Limits(position=0.02)
    with pytest.raises(LimitsError, match=r"rounded to 0.003 .* peak position 0.021"):
        Stimulus(waveform=waveform, fs=100.0, limits=limits, resolution=0.003)


def test_rounding_that_takes_a_whole_limit_is_refused_with_one_that_does():
    with pytest.raises(LimitsError, match=r"rounding to 0.1 deg at 200 Hz alone") as refusal:
        design(**WISH, resolution=0.1)
    enough = float(re.search(r"resolution of (\S+) deg", str(refusal.value))[1])
    assert design(**WISH, resolution=enough).resolution == enough


@given(x=st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=40), r=st.floats(1e-6, 0.1))
def test_room_left_for_rounding_is_enough(x, r):
    fs = 10.0
    limits = Limits(position=10.0, velocity=100.0, acceleration=1000.0, jerk=10000.0)
    room = leave_room(limits, resolution=r, fs=fs)
    x = np.array(x)
    rounded = np.round(x / r) * r
    for order, name in enumerate(QUANTITIES):
        error = np.abs(np.diff(rounded, order) - np.diff(x, order)).max() * fs**order
        given_up = getattr(limits, name) - getattr(room, name)
        assert error <= given_up * (1 + 1e-6)


# block by block


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("size", [1, 7, 256, 100_000])
def test_blocks_put_together_are_the_whole(kind, size):
    stimulus = designed_once(**SHORT, kind=kind, rng=1)
    parts = list(blocks(stimulus, size))
    for name in ("time", "position", "velocity", "acceleration"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert joined.tobytes() == getattr(stimulus, name).tobytes()
    assert max(part.time.size for part in parts) <= size


def test_blocks_at_another_rate_are_the_stimulus_sampled_there():
    stimulus = design(**WISH, resolution=1e-4)
    faster = Stimulus(waveform=stimulus.waveform, fs=777.0, tail=stimulus.tail)
    joined = np.concatenate([part.velocity for part in blocks(stimulus, 100, fs=777.0)])
    assert joined.tobytes() == faster.velocity.tobytes()
    position = np.concatenate([part.position for part in blocks(stimulus, 100)])
    assert np.array_equal(position, stimulus.commanded().position)


@pytest.mark.parametrize("size", [0, -1, 2.5, True])
def test_blocks_of_no_size_are_refused(size):
    with pytest.raises(ArgumentError, match="must be a whole number of samples"):
        blocks(Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=10.0), size)


# never silently weaker


def test_ratio_of_a_multisine_line_by_line():
    limits = Limits(position=1.0)
    wish = {"band": (1.0, 20.0), "duration": 10.0, "fs": 100.0, "limits": limits}
    stimulus = design(**wish, kind="schroeder", lead=0)
    found = signal_to_noise(stimulus, noise=0.05)
    A, N = stimulus.core.amplitudes[0], 1000
    expected = 10 * math.log10((A * N / 2) ** 2 / (N * 0.05**2))
    assert found.decibel == pytest.approx(np.full(found.frequency.size, expected), abs=1e-9)
    assert found.resolution == 0.1
    # a density that says the same as the standard deviation
    density = OverFrequency(frequency=(1.0,), value=(2 * 0.05**2 / 100.0,))
    assert signal_to_noise(stimulus, noise=density).decibel == pytest.approx(found.decibel)
    ten = signal_to_noise(stimulus, noise=0.05, resolution=1.0)
    assert ten.decibel == pytest.approx(found.decibel + 10.0)


def test_ratio_of_a_sweep_is_the_textbook_level():
    # stationary phase: |X|² = A² fs² T / (4 (f_f - f_i)), noise N σ²
    stimulus = design(**{**WISH, "limits": Limits(position=1.0)})
    found = signal_to_noise(stimulus, noise=0.1)
    inside = (found.frequency > 2.0) & (found.frequency < 13.0)
    expected = 10 * math.log10(200.0 / (4 * 14.8 * 0.1**2))
    assert found.decibel[inside].mean() == pytest.approx(expected, abs=0.1)


def test_measured_noise_is_taken_at_its_frequencies():
    rng = np.random.default_rng(5)
    white = rng.normal(0.0, 0.1, 40_000)
    coloured = np.convolve(white, np.ones(8) / 8, mode="same")  # a notch at 25 Hz
    at = np.array([1.0, 25.0])
    density = measured_noise(coloured, fs=200.0).at(at)
    assert density[0] == pytest.approx(2 * 0.1**2 / 200.0, rel=0.3)
    assert density[1] < 0.05 * density[0]
    stimulus = designed_once(**WISH)
    quiet = signal_to_noise(stimulus, noise=measured_noise(coloured, fs=200.0)).decibel
    plain = signal_to_noise(stimulus, noise=0.1).decibel
    assert quiet[-1] > plain[-1] + 2.0  # the average has fallen 4 dB at 15 Hz


@pytest.mark.parametrize("kind", ["exponential", "prbs", *in_studies("hmpim", "schroeder")])
def test_weaker_than_wanted_is_refused_with_numbers_that_do(kind):
    plain = {"band": (1.0, 15.0), "duration": 3.0, "fs": 100.0, "limits": LIMITS}
    plain |= {"kind": kind, "rng": 1}
    wish = {**plain, "noise": 0.1}
    there = signal_to_noise(designed_once(**plain), noise=0.1, band=(1.0, 15.0))
    lowest = float(there.decibel.min())
    assert design(**wish, wanted_snr=lowest - 0.01).samples > 0
    with pytest.raises(LimitsError, match=r"below the .* wanted; there the") as refusal:
        design(**wish, wanted_snr=lowest + 2.0)
    said = str(refusal.value)
    weakest = there.frequency[int(np.argmin(there.decibel))]
    assert float(re.search(r"at (\S+) Hz the signal", said)[1]) == pytest.approx(weakest, rel=1e-3)
    name = re.search(r"there the (\w+) limit binds", said)[1]
    assert name == "acceleration"
    tried = 0
    if larger := re.search(r"acceleration limit (\S+) deg/s²,? ", said):
        eased = replace(LIMITS, acceleration=float(larger[1].rstrip(",")))
        design(**{**wish, "limits": eased}, wanted_snr=lowest + 2.0)
        tried += 1
    if longer := re.search(r"a duration of (\S+) s", said):
        long = design(**{**plain, "duration": float(longer[1])})
        asked = {"noise": 0.1, "snr_db": lowest + 2.0, "band": plain["band"]}
        check_spectrum(long, **asked, resolution=1 / 3.0)
        tried += 1
    if part := re.search(r"the band (\S+) to (\S+) Hz", said):
        narrower = (float(part[1]), float(part[2]))
        stimulus = designed_once(**plain)
        given_up = {"noise": 0.1, "snr_db": lowest + 2.0, "resolution": 1 / 3.0}
        check_spectrum(stimulus, **given_up, band=narrower)
        tried += 1
    assert tried >= 2


def test_the_limit_that_binds_depends_on_the_frequency():
    limits = Limits(position=10.0, velocity=60.0, acceleration=8000.0)
    stimulus = Stimulus(waveform=design(**{**WISH, "limits": limits}).waveform, fs=200.0)
    stimulus = replace_limits(stimulus, limits)
    for frequency, name in ((0.5, "position"), (5.0, "velocity"), (30.0, "acceleration")):
        near = (0.9 * frequency, 1.1 * frequency)
        with pytest.raises(LimitsError, match=f"there the {name} limit binds; all limits"):
            check_spectrum(stimulus, noise=0.1, snr_db=200.0, band=near)


def replace_limits(stimulus, limits):
    return Stimulus(waveform=stimulus.waveform, fs=stimulus.fs, limits=limits)


def test_ratio_wanted_may_depend_on_frequency():
    stimulus = designed_once(**WISH)
    there = signal_to_noise(stimulus, noise=0.1)
    just = OverFrequency(
        frequency=tuple(there.frequency.tolist()), value=tuple((there.decibel - 0.01).tolist())
    )
    check_spectrum(stimulus, noise=0.1, snr_db=just)
    raised = list(just.value)
    raised[len(raised) // 2] += 1.0
    more = OverFrequency(frequency=just.frequency, value=tuple(raised))
    at = there.frequency[len(raised) // 2]
    with pytest.raises(LimitsError, match=f"at {at:.4g} Hz the signal-to-noise ratio"):
        check_spectrum(stimulus, noise=0.1, snr_db=more)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: signal_to_noise(s, noise=0.0), "noise = 0.0 deg"),
        (lambda s: signal_to_noise(s, noise=math.nan), "noise = nan"),
        (lambda s: signal_to_noise(s, noise=0.1, band=(1.0, 100.0)), "reaches the Nyquist"),
        (
            lambda s: check_spectrum(s, noise=0.1, snr_db=math.nan),
            "wanted_snr = nan dB is out",
        ),
        (lambda s: measured_noise(np.zeros(10), fs=10.0), "at least 64 finite samples"),
        (lambda s: OverFrequency(frequency=(2.0, 1.0), value=(1.0, 1.0)), "positive and rise"),
        (lambda s: OverFrequency(frequency=(1.0,), value=()), "do not match"),
        (
            lambda s: signal_to_noise(Stimulus(waveform=Step(duration=1.0), fs=10.0), noise=1.0),
            "a Step has no band of its own",
        ),
    ],
)
def test_refusals_of_ratios(call, message):
    with pytest.raises(ArgumentError, match=message):
        call(designed_once(**WISH))
