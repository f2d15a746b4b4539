"""The logs that the how-tos read: a chirp, and what a known unit answers to it."""

import hmpim
import sample_logs

DELAY, NATURAL_FREQUENCY, DAMPING_RATIO = 0.006, 12.0, 0.6


def flown(fs, amplitude, noise, intersample="bandlimited", seed=1):
    """Rest, a sweep, rest, and the answer of a unit of second order with a delay."""
    limits = hmpim.Limits(position=amplitude, velocity=1e6, acceleration=1e9, unit="deg")
    stimulus = hmpim.design(band=(0.5, 40), duration=5, fs=fs, limits=limits)
    unit = hmpim.Sensor(
        delay=DELAY,
        natural_frequency=NATURAL_FREQUENCY,
        damping_ratio=DAMPING_RATIO,
        noise_std=noise,
    )
    record = hmpim.run(unit, stimulus, rng=seed)
    return record.inputs[0].values, record.outputs[0].values


def betaflight(folder):
    u, y = flown(500.0, 200.0, 2.0)
    sample_logs.blackbox(folder / "flight.bbl", drive_and_answer=(u / 1000, y / 1000), fs=500.0)


def px4(folder):
    sample_logs.ulog(folder / "flight.ulg", flown(250.0, 1.0, 0.01), fs=250.0)


def ros(folder):
    sample_logs.ros(folder / "bag", drive_and_answer=flown(200.0, 0.3, 0.003), fs=200.0)


def oscilloscope(folder):
    sample_logs.oscilloscope(folder / "scope.csv", flown(500.0, 2.0, 0.01), fs=500.0)


FILES = {"betaflight": betaflight, "px4": px4, "ros-bag": ros, "oscilloscope": oscilloscope}
