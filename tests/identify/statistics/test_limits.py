"""What counts at the ends of a run, and what statistics alone do not tell apart."""

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim import Record, compress, identify

FS, NOISE = 200.0, 0.01
MODE = hmpim.Model(
    scale_factor=1.0,
    delay=0.05,
    noise_std=NOISE,
    denominator=(1 / (10 * np.pi) ** 2, 0.3 / (10 * np.pi), 1.0),
)


def answered(u, seed=1, *, model=MODE, intersample="bandlimited"):
    rng = np.random.default_rng(seed)
    return np.asarray(hmpim.simulate(model, u, fs=FS, intersample=intersample, rng=rng))


def record_of(u, y, intersample=None):
    return Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample=intersample)


def codes(pair):
    return {finding.code for finding in pair.warnings}


def test_a_run_that_ends_in_motion_at_half_the_rate_rings_there_and_the_ringing_does_not_count():
    t = np.arange(2100) / FS
    u = np.sin(2 * np.pi * (0.2 * t + 45.0 / t[-1] * t**2))  # to 90 Hz, ten samples a period less
    lead = hmpim.Model(
        scale_factor=1.0, delay=0.02, noise_std=1e-4, numerator=(0.05, 1.0), denominator=(0.02, 1.0)
    )
    y = answered(u, model=lead)
    pair = identify(compress(record_of(u[:2000], y[:2000], "bandlimited")))["y", "u"]
    assert pair.noise_std.value == pytest.approx(1e-4, rel=0.06)


def test_as_much_of_a_beginning_is_left_out_as_the_chosen_mode_remembers():
    white = np.random.default_rng(2).standard_normal(3000)
    slow, fast = (((2 * np.pi * f) ** -2, 0.2 / (2 * np.pi * f), 1.0) for f in (10.0, 13.0))
    modes = hmpim.Model(
        scale_factor=1.0,
        delay=0.05,
        noise_std=NOISE,
        numerator=tuple((np.array(fast) + np.array(slow)) / 2),
        denominator=tuple(np.polymul(slow, fast)),
    )
    y = answered(white, model=modes)
    pair = identify(compress(record_of(white[600:], y[600:], "bandlimited")))["y", "u"]
    assert pair.noise_std.value == pytest.approx(NOISE, rel=0.06)
    assert pair.structure == "two_modes"


def swept(size=3000):
    t = np.arange(size) / FS
    return np.sin(2 * np.pi * (0.2 * t + 7.4 / t[-1] * t**2))


def test_noise_slower_than_the_window_is_no_other_than_drift():
    u, rng = swept(), np.random.default_rng(2)
    still = answered(u)
    drift = 0.01 * np.cumsum(rng.standard_normal(u.size))
    quick = lfilter([1.0], [1.0, -0.8], 0.02 * rng.standard_normal(u.size))
    for added, doubted in ((drift, True), (quick, False), (0.0, False)):
        pair = identify(compress(record_of(u, still + added)))["y", "u"]
        assert ("drift_or_noise" in codes(pair)) == doubted
        assert pair.noise_std.verdict == ("doubtful" if doubted else "ok")
        assert pair.delay.verdict == "ok"


@pytest.mark.parametrize("lags", [330, 900])
def test_what_a_response_does_beyond_the_window_is_no_noise(lags):
    quiet = hmpim.Model(scale_factor=1.0, delay=0.05, noise_std=1e-5, denominator=MODE.denominator)
    rng = np.random.default_rng(3)
    u = np.concatenate([np.zeros(5), np.repeat(rng.standard_normal(600), 5)])
    record = record_of(u, answered(u, model=quiet, intersample="zoh"), "zoh")
    pair = identify(compress(record, lags=lags))["y", "u"]
    short = lags == 330
    assert ("cut_response" in codes(pair)) == short
    assert pair.noise_std.verdict == ("doubtful" if short else "ok")
    if not short:
        assert pair.noise_std.value == pytest.approx(1e-5, rel=0.06)


def test_one_pole_without_noise_may_be_a_filter():
    rng = np.random.default_rng(4)
    u = np.concatenate([np.zeros(3), rng.standard_normal(1500)])
    y = lfilter([0.0, 0.0, 0.2], [1.0, -0.8], u)
    for noise, doubted in ((0.0, True), (1e-3, False)):
        heard = y + noise * rng.standard_normal(y.size)
        pair = identify(compress(record_of(u, heard, "zoh")))["y", "u"]
        assert ("perhaps_software" in codes(pair)) == doubted
        assert pair.delay.verdict == ("doubtful" if doubted else "ok")
        assert pair.scale_factor.verdict == "ok"
