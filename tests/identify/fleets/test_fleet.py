"""Records fitted together say what each says alone, or that they do not."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.identify.fleets.fleet import fit_fleet, parameters_of
from hmpim.identify.fleets.learnt import box_around, learn_fleet
from hmpim.identify.fleets.surface import Surface, places_in
from hmpim.identify.fleets.whole import learn_whole, whole_pairs

FS, SAMPLES, LEARNT = 100.0, 600, 6
NOISE = 0.1
"""At which no record tells what the input does between its samples."""

NAMES = ("delay", "scale_factor", "bias", "noise_std", "natural_frequency", "damping_ratio",
         "bandwidth_phase90", "bandwidth_3db", "peak_gain_db", "delay_low_frequency")  # fmt: skip


def sweep() -> np.ndarray:
    time = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.2 * time + 19.8 / 12 * time**2))


def output(seed: int, delay: float = 0.03, natural: float = 6.0, u=None, noise=NOISE) -> np.ndarray:
    rng = np.random.default_rng([3, seed])
    delay *= 1 + 0.03 * rng.standard_normal()
    omega = 2 * np.pi * natural * (1 + 0.03 * rng.standard_normal())
    model = hmpim.Model(
        delay=delay, scale_factor=2.0, denominator=(omega**-2, 0.8 / omega, 1.0), bias=0.3
    )
    y = hmpim.simulate(model, sweep() if u is None else u, fs=FS, intersample="bandlimited")
    return y + noise * rng.standard_normal(SAMPLES)


def low_sweep() -> np.ndarray:
    """A sweep that ends below the -3 dB bandwidth of most units."""
    time = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.2 * time + 6.8 / 12 * time**2))


def alone(y: np.ndarray, intersample: str | None = None):
    record = hmpim.Record.from_arrays({"u": sweep()}, {"y": y}, fs=FS, intersample=intersample)
    return hmpim.identify(record)["y", "u"]


@pytest.fixture(scope="module")
def fleet():
    pairs = [alone(output(seed)) for seed in range(LEARNT)]
    found = learn_fleet(sweep(), pairs, fs=FS, band=(0.2, 20.0))
    assert found is not None
    return found


def test_together_is_as_alone(fleet):
    """Values and intervals to a hundredth of their half width, also where they cover several
    assumptions, or one more pole that one record asks for by chance."""
    outputs = np.stack([output(seed) for seed in range(40, 80)])
    fit = fit_fleet(fleet, outputs)
    assert len(fleet.members) == 3
    assert np.count_nonzero(fit.sound) >= 36
    assert all("intersample" in fit.codes[k] for k in np.flatnonzero(fit.sound))
    asking = next(k for k, codes in enumerate(fit.codes) if "structure" in codes)
    for k in {*np.flatnonzero(fit.sound)[:3].tolist(), asking}:
        pair, together = alone(outputs[k]), parameters_of(fit.columns, k)
        assert pair.intersample == fit.intersample[k]
        assert tuple(warning.code for warning in pair.warnings) == fit.codes[k]
        for name in NAMES:
            one, other = getattr(pair, name), getattr(together, name)
            half = (one.ci95[1] - one.ci95[0]) / 2
            assert other.value == pytest.approx(one.value, abs=0.01 * half), name
            assert other.ci95 == pytest.approx(one.ci95, abs=0.02 * half), name
            assert (other.std is None) == (one.std is None), name
    assert together.delay.std is None  # it covers all three


def test_intervals_cover_a_missing_zero_together_as_they_do_alone(fleet):
    """By chance one record in forty asks for it: of it the delay's interval is twice as wide."""
    seeds = (40, 115, 260)
    fit = fit_fleet(fleet, np.stack([output(seed) for seed in seeds]))
    assert fit.sound.all()
    wide = []
    for k, seed in enumerate(seeds):
        pair, together = alone(output(seed)), parameters_of(fit.columns, k)
        for name in NAMES:
            one, other = getattr(pair, name), getattr(together, name)
            half = (one.ci95[1] - one.ci95[0]) / 2
            assert other.ci95 == pytest.approx(one.ci95, abs=0.02 * half), name
        wide.append(together.delay.ci95[1] - together.delay.ci95[0])
    assert min(wide[1:]) > 1.5 * wide[0]


def test_an_interval_that_covers_a_missing_zero_does_not_stretch_the_box():
    """The box holds the fits of the units: what a zero would move is no place of theirs."""
    ordinary = [alone(output(seed), "bandlimited") for seed in range(LEARNT)]
    zero = alone(output(115), "bandlimited")
    assert zero.delay.spread > 3 * ordinary[0].delay.spread
    sides = []
    for pairs in (ordinary, [*ordinary, zero]):
        found = learn_fleet(sweep(), pairs, fs=FS, band=(0.2, 20.0))
        (member,) = found.members
        sides.append(member.surface.high[0] - member.surface.low[0])
    assert sides[1] < 1.2 * sides[0]


def test_what_is_not_of_the_kind_is_left_to_itself(fleet):
    far, faster = output(40, delay=0.06), output(41, natural=12.0)
    clipped = np.minimum(output(42), 1.2)
    stray = output(43)
    stray[300:] += 1.0  # a step of its own
    rounded = np.round(output(45), 1)
    fit = fit_fleet(fleet, np.stack([far, faster, clipped, stray, rounded, output(44)]))
    assert fit.sound.tolist() == [False] * 5 + [True]
    assert fit.sound.tolist() == [False] * 5 + [True]


def test_everything_is_said_of_quiet_records_and_of_no_others(fleet):
    """What a fit of all together passes for sound is still asked what `identify` asks."""
    whole = learn_whole(fleet, [alone(output(seed)) for seed in range(LEARNT)])
    assert whole is not None
    time = np.arange(SAMPLES) / FS
    plain = output(44)
    bent = output(46)
    bent += 0.03 * (bent - 0.3) ** 2  # harmonics of 3 %
    ringing = output(47)
    ringing += 1.5 * np.exp(-10.0 * time) * np.cos(2 * np.pi * 6.0 * time)  # not from rest
    spike = output(48)
    spike[200] += 10 * NOISE
    every = np.stack([plain, bent, ringing, spike])
    fit = fit_fleet(fleet, every)
    told = whole_pairs(whole, fit, every)
    assert fit.sound[0]
    assert told[1:] == [None, None, None]
    pair, own = alone(plain), told[0]
    assert own is not None
    assert own.verdict == pair.verdict == "ok"
    assert own.warnings == pair.warnings
    assert own.nonlinearity == pair.nonlinearity
    assert own.denominator == pytest.approx(pair.denominator, rel=1e-4)


def test_a_bandwidth_beyond_the_band_is_missing_together_as_it_is_alone():
    """It is not read off, and a record that lacks it is not left to `identify` for that."""
    u, band = low_sweep(), (0.2, 7.0)

    def measured(seed: int) -> np.ndarray:
        return output(seed, u=u, noise=0.02)

    def single(seed: int):
        record = hmpim.Record.from_arrays(
            {"u": u}, {"y": measured(seed)}, fs=FS, intersample="bandlimited", band=band
        )
        return hmpim.identify(record)["y", "u"]

    pairs = [single(seed) for seed in range(8)]
    fleet = learn_fleet(u, pairs, fs=FS, band=band)
    assert "bandwidth_3db" in fleet.names
    whole = learn_whole(fleet, pairs)
    assert whole is not None
    every = np.stack([measured(seed) for seed in (40, 41)])
    found = whole_pairs(whole, fit_fleet(fleet, every), every)
    for seed, own in zip((40, 41), found, strict=True):
        pair = single(seed)
        assert own.bandwidth_3db is None
        assert pair.bandwidth_3db is None
        assert own.warnings == pair.warnings
        assert own.verdict == pair.verdict


def test_intervals_cover_a_nonlinearity_that_looks_likely_by_chance_as_they_do_alone(fleet):
    """One record in two hundred looks bent enough for it."""
    whole = learn_whole(fleet, [alone(output(seed)) for seed in range(LEARNT)])
    seeds = (276, 492, 44)
    outputs = np.stack([output(seed) for seed in seeds])
    fit = fit_fleet(fleet, outputs)
    together = whole_pairs(whole, fit, outputs)
    linear = whole_pairs(replace(whole, shapes=whole.shapes[:0]), fit, outputs)
    wider = []
    for k, y in enumerate(outputs):
        pair = alone(y)
        for name in NAMES:
            one, other = getattr(pair, name), getattr(together[k].parameters, name)
            half = (one.ci95[1] - one.ci95[0]) / 2
            assert other.ci95 == pytest.approx(one.ci95, abs=0.02 * half), name
        ends = [np.ptp(p.parameters.scale_factor.ci95) for p in (together[k], linear[k])]
        wider.append(ends[0] / ends[1])
    assert min(wider[:2]) > 2
    assert wider[2] == 1


def test_a_record_that_almost_asks_for_other_dynamics_is_left_to_itself(fleet):
    outputs = np.stack([output(seed) for seed in (256, 433, 44)])
    assert "structure" in {warning.code for warning in alone(outputs[0]).warnings}
    assert fit_fleet(fleet, outputs).sound.tolist() == [False, False, True]


def test_a_unit_held_against_more_structures_does_not_keep_the_others_apart(fleet):
    pairs = [alone(output(seed)) for seed in range(LEARNT)]
    rival = next(c for c in pairs[0].candidates if c.structure == "first_order")
    more = (*pairs[0].candidates, replace(rival, intersample="zoh"))
    assert learn_whole(fleet, [replace(pairs[0], candidates=more), *pairs[1:]]) is not None


def test_units_of_two_kinds_teach_nothing():
    pairs = [alone(output(seed)) for seed in range(LEARNT - 1)]
    other = alone(sweep() + 0.02 * np.random.default_rng(0).standard_normal(SAMPLES))
    assert other.structure == "static"
    assert learn_fleet(sweep(), [*pairs, other, other], fs=FS, band=(0.2, 20.0)) is None
    assert learn_fleet(sweep(), pairs[:3], fs=FS, band=(0.2, 20.0)) is None


def test_a_surface_knows_its_error():
    """A bend sharper than its degree is seen by points that took no part in the fit."""
    low, high = np.array([-1.0]), np.array([1.0])
    places = places_in(low, high, 6)
    smooth = Surface.fitted(low, high, places, np.exp(places), degree=6)
    bent = Surface.fitted(low, high, places, np.abs(places - 0.1), degree=6)
    assert smooth.error[0] < 1e-5 < 0.01 < bent.error[0]
    at = np.array([[0.37]])
    value, slope = smooth.at(at)
    assert value[0, 0] == pytest.approx(np.exp(0.37), abs=1e-5)
    assert slope[0, 0, 0] == pytest.approx(np.exp(0.37), abs=1e-4)


def test_a_box_learnt_from_sixteen_units_holds_the_others():
    """A unit outside costs as much as fifty inside: less than one in a thousand may be."""
    rng = np.random.default_rng(4)
    outside = 0
    for _ in range(200):
        low, high = box_around(rng.standard_normal((16, 3)), np.zeros(3))
        others = rng.standard_normal((500, 3))
        outside += np.count_nonzero(((others < low) | (others > high)).any(axis=1))
    assert outside < 1e-3 * 200 * 500
