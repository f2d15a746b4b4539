"""What a record can tell: covariance, bound, and what cannot be told apart."""

import numpy as np
import pytest
from families.bound import derivatives, information
from families.catalogue import FAMILIES
from families.drive import Drive, Samples
from families.noise import Noise, pink, white
from families.simulate import linear_output
from families.study import draw_of
from families.system import System
from families.take import finish, shoot

FS = 100.0


def held(values):
    source = Samples(np.asarray(values, float), FS)
    return Drive(source=source, between="zoh", band=(0.1, 40.0), fs=FS, samples=len(values))


def test_noise_has_the_covariance_it_states():
    noise = Noise(parts=((1.0, 0.9, 0.5), (0.5, 0.0, 0.0)))
    rng = np.random.default_rng(1)
    draws = np.stack([noise.draw(40, rng) for _ in range(20_000)])
    seen = draws.T @ draws / 20_000
    assert seen[10, 10:16] == pytest.approx(noise.covariance(np.arange(6)), abs=0.05)
    assert pink(1000).variance == pytest.approx(1.0)


@pytest.mark.parametrize("colour", [white(), Noise(parts=((1.0, 0.95, 0.0),))])
def test_a_fit_that_knows_the_truth_scatters_as_the_bound_says(colour):
    """Gauss and Newton from the truth, the noise's covariance known: the best there is."""
    system = System(delay=0.1, gain=1.5, bias=0.3, pairs=((3.0, 0.3),))
    drive = held(np.random.default_rng(0).standard_normal(400))
    vector = system.vector()
    steps = np.array([1e-5, 1e-5, 1e-5, 1e-5, 1.0])

    def output(v):
        return linear_output(system.moved(v), drive)

    rows = derivatives(output, vector, steps)
    noise = colour.scaled(0.02)
    told = information(rows, noise)
    gain, covariance = told.gain, told.covariance
    rng, found = np.random.default_rng(2), []
    for _ in range(150):
        y = output(vector) + noise.draw(400, rng)
        here = vector + gain @ (y - output(vector))
        found.append(here + gain @ (y - output(here)) - vector)
    z = np.array(found) / np.sqrt(np.diag(covariance))
    assert np.abs(z.mean(axis=0)).max() < 0.35
    assert z.std(axis=0) == pytest.approx(np.ones(5), abs=0.22)


def test_what_a_record_does_not_show_has_no_bound():
    rows = np.stack([np.ones(50), np.zeros(50)], axis=1)
    covariance = information(rows, white()).covariance
    assert covariance[0, 0] == pytest.approx(1 / 50)
    assert np.isinf(covariance[1, 1])


def swept(between):
    return Drive(
        source=lambda t: np.where(t > 0, np.sin(2 * np.pi * (0.1 + 0.5 * t) * t), 0.0),
        between=between,
        band=(0.1, 10.0),
        fs=FS,
        samples=1000,
    )


@pytest.mark.parametrize(("snr_db", "apart"), [(20.0, True), (100.0, False)])
def test_held_or_not_matters_to_the_delay_only_where_it_cannot_be_told(snr_db, apart):
    """Half a sample: in noise the hull spans it, without noise the record tells."""
    system = System(delay=0.1, pairs=((3.0, 0.5),))
    draw = finish(shoot(np.random.default_rng(3), system, swept("zoh"), snr_db=snr_db))
    delay = draw.figures["delay"]
    least = 3 * 2 * 1.96 * delay.bound
    assert delay.hull is apart
    assert (delay.widest - least > 3 * 0.4 / FS) is apart
    assert draw.figures["bias"].hull is False


def test_a_held_gain_is_known_to_a_sample_only():
    values = np.random.default_rng(0).choice([-1.0, 1.0], 300)
    take = shoot(np.random.default_rng(1), System(delay=0.013), held(values), snr_db=40)
    draw = finish(take)
    assert not draw.figures["delay"].tellable
    assert draw.figures["scale_factor"].tellable


def test_a_bandwidth_outside_the_band_need_not_be_told():
    system = System(delay=0.0, pairs=((14.0, 0.7),))
    draw = finish(shoot(np.random.default_rng(1), system, swept("smooth"), snr_db=80))
    assert not draw.figures["bandwidth_3db"].tellable
    assert draw.figures["natural_frequency"].tellable


SOUND = ("second order", "PRBS held", "mid-sweep", "AR(0.99)", "thermal", "mains", "jitter")


def missed(names, count):
    """By how many deviations the estimator that knows the truth misses."""
    found = [draw_of(FAMILIES[name], 5, k).oracle for name in names for k in range(count)]
    return np.concatenate([z[np.isfinite(z)] for z in found if z is not None])


def test_the_truth_of_a_record_is_the_truth():
    """Bound, noise, nuisances and stamps fit the record, or this scatter would not be 1."""
    z = missed(SOUND, 4)
    assert 0.8 < np.sqrt(np.mean(z**2)) < 1.2
    assert np.abs(z).max() < 4.5


@pytest.mark.study
@pytest.mark.parametrize("name", sorted(set(FAMILIES) - {"1 000 000 samples", "unrelated"}))
def test_the_truth_of_every_family_is_the_truth(name):
    if draw_of(FAMILIES[name], 5, 0).oracle is None:
        pytest.skip("no linear system under an input")
    z = missed([name], 30)
    slack = 0.45 if name == "late frames" else 0.25  # its noise is louder where the sweep is fast
    assert abs(np.sqrt(np.mean(z**2)) - 1) < slack
