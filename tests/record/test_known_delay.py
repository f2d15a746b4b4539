"""No path from stamps to the common clock moves a delay: every one with a delay that is known."""

import re

import numpy as np
import pytest

from hmpim.errors import RecordError
from hmpim.identify import identify
from hmpim.record import Channel, Record, Series, uniform
from hmpim.record.mend import mend
from tests_support import in_studies

DELAY = 0.0123
FS = 100.0
DURATION = 20.0


def sweep(t):
    """Linear sweep, 0.2 to 20 Hz, started softly and ended softly; defined at any instant."""
    inside = np.clip(t / DURATION, 0.0, 1.0)
    edge = np.clip(np.minimum(inside, 1.0 - inside) * 10.0, 0.0, 1.0)
    phase = 2 * np.pi * DURATION * (0.2 * inside + 9.9 * inside**2)
    return np.sin(phase) * np.sin(np.pi / 2 * edge) ** 2


def answered(t):
    return sweep(t - DELAY)


def delay_of(time, values, truth):
    """Delay in s by which `values` are late on `truth`, by least squares; shape (n,)."""
    step = 1e-5
    slope = (truth(time + step) - truth(time - step)) / (2 * step)
    return -float(slope @ (values - truth(time)) / (slope @ slope))


def every(fs, *, late=0.0):
    return np.arange(late, DURATION, 1.0 / fs)


def strewn(fs, share):
    time = every(fs)
    return time + share / fs * np.random.default_rng(3).uniform(-1, 1, time.size)


def without(time, *spans):
    keep = np.ones(time.size, dtype=bool)
    for start, stop in spans:
        keep &= (time < start) | (time > stop)
    return time[keep]


PATHS = {
    "one clock": (every(FS), every(FS)),
    "beside": (every(FS, late=0.0037), every(FS)),
    "input ten times as fast": (every(1000.0), every(FS)),
    "input ten times as fast, beside": (every(1000.0, late=0.0004), every(FS)),
    "input 3.73 times as fast": (every(373.0), every(FS)),
    "output ten times as fast": (every(FS), every(1000.0)),
    "output 1.7 times as fast": (every(FS), every(170.0, late=0.002)),
    "both strewn": (strewn(FS, 0.3), strewn(FS, 0.3)),
    "fast and strewn input": (strewn(1000.0, 0.3), every(FS)),
    "gaps in both": (
        without(every(FS, late=0.004), (5, 5.5), (12, 12.1)),
        without(every(FS), (8, 8.3)),
    ),
    "fast input with gaps": (without(every(1000.0), (5, 5.5), (8.001, 8.003)), every(FS)),
    "held up now and then": (every(FS), without(every(FS), (3, 3.01), (9, 9.02), (15, 15.01))),
}


@pytest.mark.parametrize("name", PATHS)
def test_delay_stays_where_it_is(name):
    t_u, t_y = PATHS[name]
    # What lies above half the lower rate must not fold: a tone there, in the faster input.
    tone = 0.3 * np.sin(2 * np.pi * 130.0 * t_u) if name.startswith("input ten") else 0.0
    record = Record(
        inputs=(Channel(name="u", time=t_u, values=sweep(t_u) + tone),),
        outputs=(Channel(name="y", time=t_y, values=answered(t_y)),),
        fs=FS,
    )
    aligned = uniform(record)
    u, y = aligned.inputs[0], aligned.outputs[0]
    both = u.valid & y.valid & (aligned.time > 0.5) & (aligned.time < DURATION - 0.5)
    time = aligned.time[both]
    moved = delay_of(time, y.values[both], answered) - delay_of(time, u.values[both], sweep)
    assert abs(moved) < 0.01 / aligned.fs
    # Nor does anything else happen to the signals.
    for signal, truth in ((u, sweep), (y, answered)):
        error = np.sqrt(np.mean((signal.values[both] - truth(time)) ** 2))
        assert error < (0.004 if "strewn" in name else 3e-3), (signal.name, error)


@pytest.mark.parametrize(
    ("stamps", "code"),
    [
        (lambda t: np.floor(t * 1000 + 1e-9) / 1000, "doubled_stamps"),
        (lambda t: np.round(t, 3), "doubled_stamps"),
    ],
    ids=["cut", "rounded"],
)
def test_stamps_printed_too_coarsely_are_spread(stamps, code):
    t = every(2000.0)
    time = stamps(t)
    mended = mend(
        [
            Series(name="u", values=sweep(t), time=time),
            Series(name="y", values=answered(t), time=time),
        ]
    )
    (finding,) = mended.findings
    assert finding.code == code
    assert "spread evenly, 0.0005 s apart (2000 Hz)" in finding.message
    u, y = mended.channels
    assert u.time is y.time or np.array_equal(u.time, y.time)
    assert np.abs(np.diff(u.time) - 5e-4).max() < 1e-8
    moved = delay_of(y.time, y.values, answered) - delay_of(u.time, u.values, sweep)
    assert abs(moved) < 0.01 / 2000.0


@pytest.mark.parametrize(
    ("clock", "stamps"),
    [
        (every(2000.0), lambda t: np.array([float(f"{x:.4g}") for x in t])),
        (
            without(every(2000.0), (5, 5.7), (12, 12.0031)),
            lambda t: np.floor(t * 1000 + 1e-9) / 1000,
        ),
    ],
    ids=["ever more coarsely", "with pauses"],
)
def test_a_coarse_clock_is_seen_through_its_digits_and_pauses(clock, stamps):
    """Samples that share a stamp are neither dropped nor moved within a packet."""
    time = stamps(clock)
    mended = mend(
        [
            Series(name="u", values=sweep(clock), time=time),
            Series(name="y", values=answered(clock), time=time),
        ]
    )
    (finding,) = mended.findings
    assert "spread evenly, 0.0005 s apart (2000 Hz)" in finding.message
    found = mended.channels[0].time
    assert found.size == clock.size
    assert np.abs(found - clock - np.median(found - clock)).max() < 5e-4
    steps = np.diff(clock) < 6e-4  # but for the pauses
    assert np.diff(found)[steps] == pytest.approx(5e-4, abs=2e-7)


@pytest.mark.parametrize("tick", [0.1, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("cut", [np.floor, np.round], ids=["cut", "rounded"])
@pytest.mark.parametrize("fs", [200.0, 187.3])
def test_the_rate_of_a_clock_of_few_ticks_is_right_to_a_sample(tick, cut, fs):
    """The ends of the record hold parts of a tick: of stamps in whole seconds the rate was 1 % off.

    A tick begins within one sample of where its stamp does, so that the rate is known to one
    sample over the whole ticks.
    """
    clock = every(fs)[: int(15.3 * fs)]
    mended = mend([Series(name="u", values=sweep(clock), time=tick * cut(clock / tick + 1e-9))])
    found = np.diff(mended.channels[0].time)
    whole = (15.3 // tick - 2.0) * tick * fs
    assert found == pytest.approx(1.0 / fs, rel=1.0 / whole)


def test_a_clock_of_two_ticks_tells_no_rate():
    """Ten seconds of Unix time in nine digits: the rate was 82 Hz for 200 Hz, and all was ok."""
    clock = every(200.0)[:1824]
    stamps = [float(f"{t + 1.7e9:.9g}") for t in clock]
    with pytest.raises(
        RecordError, match=r"2 stamps for 1824 samples, which .* the rate with --fs"
    ):
        mend([Series(name="u", values=sweep(clock), time=np.array(stamps))])


def test_a_coarse_clock_that_wanders_is_followed():
    """A loop that runs freely, 1.7 samples to a printed millisecond: none is dropped."""
    rng = np.random.default_rng(2)
    clock = np.cumsum(6e-4 + 2e-5 * rng.standard_normal(33_000))
    time = np.floor(1000 * clock) / 1000
    assert np.abs(clock - np.linspace(clock[0], clock[-1], clock.size)).max() > 1.05e-3
    mended = mend(
        [
            Series(name="u", values=sweep(clock), time=time),
            Series(name="y", values=answered(clock), time=time),
        ]
    )
    found = mended.channels[0].time
    assert found.size == clock.size
    late = found - clock
    assert np.std(late) < 1.5e-4
    assert np.abs(late - np.median(late)).max() < 6e-4


def test_doubled_late_and_missing_samples_move_no_delay():
    t = every(FS)
    rng = np.random.default_rng(5)
    u, y = sweep(t), answered(t)
    y[rng.choice(t.size, 40, replace=False)] = np.nan
    order = np.arange(t.size)
    swapped = rng.choice(np.arange(10, t.size - 10, 3), 30, replace=False)
    order[swapped], order[swapped + 1] = swapped + 1, swapped
    again = np.sort(np.concatenate((np.arange(t.size), rng.choice(t.size, 25, replace=False))))
    pick = order[again]
    time = t[pick]
    mended = mend(
        [Series(name="u", values=u[pick], time=time), Series(name="y", values=y[pick], time=time)]
    )
    codes = {f.code: f.message for f in mended.findings}
    assert set(codes) == {"backward_stamps", "doubled_stamps", "missing_samples"}
    assert "25 of 2025 stamps" in codes["doubled_stamps"]
    assert "40 of 2000 samples of 'y'" in codes["missing_samples"]
    record = Record(inputs=mended.channels[:1], outputs=mended.channels[1:], fs=FS)
    aligned = uniform(record)
    assert [f.code for f in aligned.findings] == ["gaps"]
    valid = aligned.outputs[0].valid
    assert np.count_nonzero(~valid) == 40
    moved = delay_of(aligned.time[valid], aligned.outputs[0].values[valid], answered)
    assert abs(moved) < 1e-4 / FS
    assert np.array_equal(aligned.inputs[0].values, sweep(t))


def test_what_folds_is_said():
    t_u, t_y = every(1000.0), every(FS)
    values = sweep(t_u) + 0.3 * np.sin(2 * np.pi * 130.0 * t_u)
    record = Record(
        inputs=(Channel(name="u", time=t_u, values=values),),
        outputs=(Channel(name="y", time=t_y, values=answered(t_y)),),
        fs=FS,
    )
    codes = {f.code: f.message for f in uniform(record).findings}
    assert "taken out" in codes["resampled"]
    said = re.match(r"([\d.]+) % of the power of 'u' lies above 50 Hz", codes["folded"])
    # Of the tone and the sweep, both seen through a Hann window.
    seen = np.hanning(t_u.size) ** 2
    tone, swept = 0.09 / 2 * seen.mean(), np.mean(seen * sweep(t_u) ** 2)
    assert float(said[1]) == pytest.approx(100 * tone / (tone + swept), rel=0.02)


LAG = 0.05


def lagged(time, u, at):
    """What a lag of first order answers to an input that is held, exactly, at any instants."""
    state = np.zeros(time.size)
    decay = np.exp(-np.diff(time) / LAG)
    for k, part in enumerate(decay):
        state[k + 1] = u[k] + (state[k] - u[k]) * part
    place = np.searchsorted(time, at + 1e-12, side="right") - 1
    since = at - time[place]
    return u[place] + (state[place] - u[place]) * np.exp(-since / LAG)


HELD = {
    "beside": (every(FS, late=0.004), every(FS)),
    "by another clock, 500 ppm fast": (0.0013 + every(FS) / 1.0005, every(FS)),
    "input strewn": (strewn(FS, 0.3), every(FS)),
    "output 1.7 times as fast": (every(FS), every(170.0, late=0.002)),
    "input 3.73 times as fast": (every(373.0), every(FS)),
    "both strewn": (strewn(FS, 0.3), strewn(FS, 0.2)),
    "together": (every(FS), every(FS)),
    "output twice as fast": (every(FS), every(200.0)),
}
FEW = [("zoh", "beside"), ("foh", "beside"), ("zoh", "input strewn"), ("zoh", "together")]
MORE = [(between, name) for between in ("zoh", "foh") for name in HELD]


def answered_record(between, name, *, seed=1, stated=True):
    """A lag behind a held or linear input; its answer is exact wherever it is sampled."""
    t_u, t_y = HELD[name]
    t_y = t_y[(t_y > t_u[0] + 0.02) & (t_y < t_u[-1])]
    u = sweep(t_u)
    if between == "zoh":
        y = lagged(t_u, u, t_y - DELAY)
    else:  # 100 short holds of the middle of each piece
        fine = np.interp(np.arange(100 * (t_u.size - 1) + 1) / 100, np.arange(t_u.size), t_u)
        y = lagged(fine, np.interp(fine + 0.5 * (fine[1] - fine[0]), t_u, u), t_y - DELAY)
    return Record(
        inputs=(Channel(name="u", time=t_u, values=u),),
        outputs=(
            Channel(
                name="y",
                time=t_y,
                values=y + 0.003 * np.random.default_rng(seed).standard_normal(t_y.size),
            ),
        ),
        fs=FS,
        intersample=between if stated else None,
    )


@pytest.mark.parametrize(("between", "name"), [*FEW, *in_studies(*set(MORE).difference(FEW))])
def test_a_delay_behind_corners_between_the_samples_is_found(between, name):
    record = answered_record(between, name)
    found = identify(record, structures=["first_order"])["y", "u"]
    assert abs(found.delay.value - DELAY) < 0.01 / FS
    assert found.delay.verdict == "ok"
    assert found.parameters.time_constant.value == pytest.approx(LAG, rel=2e-3)
    assert found.parameters.noise_std.value == pytest.approx(0.003, rel=0.1)


def test_structure_and_delay_are_found_behind_a_hold_of_another_clock():
    """What folds looks like a faster pole, until it is taken out."""
    stated = answered_record("zoh", "beside")
    found = identify(stated)["y", "u"]
    assert (found.structure, found.delay.verdict) == ("first_order", "ok")
    assert abs(found.delay.value - DELAY) < 0.01 / FS
    (said,) = [w for w in found.warnings if w.code == "held_between"]
    assert said.severity == "info"
    # Said to `identify` alone, it is the same.
    again = identify(answered_record("zoh", "beside", stated=False), intersample="zoh")["y", "u"]
    assert again.delay == found.delay
