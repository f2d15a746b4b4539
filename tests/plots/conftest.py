"""One result for all pictures."""

import pytest

import hmpim


@pytest.fixture(scope="session")
def identified():
    limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    stimulus = hmpim.design(band=(0.1, 20), duration=5, fs=100, limits=limits)
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
    return hmpim.identify(hmpim.run(sensor, stimulus, rng=1))
