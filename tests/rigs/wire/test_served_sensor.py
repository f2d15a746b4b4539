"""A served sensor answers as it does in one piece, and a run over a wire ends when it is sure."""

from dataclasses import replace

import numpy as np
import pytest
from stopping import LIMITS, TARGETS, repeated, sensor
from typer.testing import CliRunner

import hmpim
from hmpim.cli.main import app
from hmpim.errors import ArgumentError
from hmpim.experiment import RunOptions
from hmpim.rigs import ManualClock, Sensor
from hmpim.rigs.wire import FarEnd, Order, SensorPlant, WireRig, sensor_hello
from wire_support import Network

FS = 200.0
WIDE = hmpim.Limits(position=3.0, velocity=130.0, acceleration=17000.0)


def read(unit, stimulus, rng=0):
    plant = SensorPlant(unit, rate=stimulus.fs, rng=np.random.default_rng(rng))
    rows = np.column_stack((stimulus.position, stimulus.velocity, stimulus.acceleration))
    return np.array(
        [
            plant.advance(Order(position=p, velocity=v, acceleration=a))[0]
            for p, v, a in rows[:, :, None]
        ]
    )


@pytest.mark.parametrize(
    "unit",
    [
        sensor(noise_std=0.0),
        sensor(noise_std=0.0, delay=0.1537, damping_ratio=1.0),
        Sensor(delay=0.0031, time_constant=0.02, scale_factor=-2.0),
        Sensor(delay=0.0125, bias=0.1, saturation_low=-0.4, saturation_high=0.5),
    ],
)
def test_tick_by_tick_it_answers_as_in_one_piece(unit):
    """Between samples one sees the polynomials, the other the sweep itself."""
    stimulus = repeated(duration=2.4)
    whole = hmpim.run(unit, stimulus).outputs[0].values
    assert np.abs(read(unit, stimulus) - whole).max() < 2e-5 * np.ptp(whole)


def test_its_noise_is_drawn_once_a_tick():
    stimulus, unit = repeated(duration=2.4), sensor()
    noise = read(unit, stimulus) - read(replace(unit, noise_std=0.0), stimulus)
    assert noise.std() == pytest.approx(0.1, rel=0.15)
    assert np.array_equal(read(unit, stimulus), read(unit, stimulus))


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        (Sensor(hold_period=0.1), "hold_period = 0.1 is not simulated over a wire"),
        (Sensor(measures="velocity"), "measures = 'velocity' is not"),
        (Sensor(time_constant=1e-4), "poles lie at 1592 Hz, too fast to be stepped at 200 Hz"),
    ],
)
def test_what_cannot_be_served_is_refused(unit, words):
    with pytest.raises(ArgumentError, match=words):
        SensorPlant(unit, rate=FS, rng=np.random.default_rng(0))


def test_an_axis_without_limits_is_refused():
    with pytest.raises(ArgumentError, match="no velocity limit is stated for 'sensor'"):
        sensor_hello(sensor(), rate=FS, watchdog=0.08, limits=LIMITS)


def test_what_is_no_sensor_is_not_served_as_one(tmp_path):
    path = tmp_path / "unit.toml"
    path.write_text('rig = "table"\n')
    told = CliRunner().invoke(app, ["table", "--udp", "127.0.0.1:0", "--sensor", str(path)])
    assert told.exit_code == 2
    assert "describes 'table', and a sensor is needed" in told.stderr


@pytest.mark.few(2)
def test_over_the_wire_a_run_ends_when_it_is_sure(seeds):
    """Datagrams take 2 to 5 ms, one of a hundred is lost; far clock 3 s ahead, 50 ppm fast."""
    off, times = [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)

        def way(number, rng=rng):
            lost = number > 20 and rng.random() < 0.01
            return None if lost else 2e-3 + 3e-3 * rng.random()

        clock = ManualClock()
        hello = sensor_hello(sensor(), rate=FS, watchdog=0.08, limits=WIDE)
        plant = SensorPlant(sensor(), rate=FS, rng=rng)
        network = Network(clock, FarEnd(hello), plant, there=way, back=way, offset=3.0, drift=5e-5)
        rig = WireRig(transport=network, clock=clock)
        record = hmpim.run(
            rig, repeated(), until=hmpim.Until(**TARGETS), options=RunOptions(clock=clock)
        )
        times.append(record.stopping.time)
        pair = hmpim.identify(record)["motion.position", "motion.command"]
        off += [(pair.delay.value - 0.15) / pair.delay.std]
        off += [(pair.natural_frequency.value - 10.0) / pair.natural_frequency.std]
    assert np.median(times) < 1.8
    assert np.abs(off).max() < 4.5
