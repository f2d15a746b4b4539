"""A unit on a carrier: two clocks, one run, two models."""

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RigError
from hmpim.experiment import ManualClock, RunOptions, run
from hmpim.identify import identify
from hmpim.rigs import (
    CarriedSensor,
    ChannelSpec,
    Layout,
    MotionTable,
    Mounted,
    Rig,
    Samples,
    Sensor,
)
from hmpim.rigs.mounted.arrivals import fit_one_way
from hmpim.stimulus import Limits, design
from tests_support import in_studies

LIMITS = Limits(position=3, velocity=150, acceleration=3500, unit="deg")
SWEEP = design(band=(0.5, 30), duration=5, fs=500, limits=LIMITS, axis="yaw")
TRUTH = {"delay": 0.012, "natural_frequency": 8.0, "damping_ratio": 0.5, "scale_factor": 1.1}
SEEKER = Sensor(**TRUTH, bias=0.2, noise_std=0.01, name="seeker", output_name="angle")


class Axis:
    """A carrier of one or two axes, exact: it is where it is commanded, and its encoder says so."""

    name, limits, moves, watchdog = "axis", LIMITS, False, None

    def __init__(self, axes=("yaw",), layout=True):
        self.axes, self.layout, self.told = axes, layout, []

    def __enter__(self):
        self.told.append("enter")
        return self

    def __exit__(self, *_):
        self.told.append("exit")

    def prepare(self, stimulus):
        self.told.append("prepare")
        if not self.layout:
            return None
        channels = [
            ChannelSpec(name=f"{axis}.{what}", role=role, unit="deg", axis=axis,
                        quantity="position", commanded=role == "input")
            for what, role in (("command", "input"), ("position", "output"))
            for axis in self.axes
        ]  # fmt: skip
        return Layout(channels=tuple(channels), intersample="bandlimited")

    def play(self, block):
        return {f"{axis}.position": block.of(axis) for axis in self.axes}

    def stop(self):
        self.told.append("stop")


PLAIN = ["second_order", "third_order"]


def near(estimate, truth, *, at_least=0.0):
    return abs(estimate.value - truth) < max(4.5 * estimate.spread, at_least)


class Paced(Axis):
    """A carrier that sends each command when it is due, by the clock of the run."""

    def use_clock(self, clock):
        self.clock = clock

    def play(self, block):
        for _ in block.due():
            pass
        return super().play(block)


def test_an_encoder_is_stamped_as_its_command_is_and_all_go_by_the_clock_of_the_run():
    clock = ManualClock(late=np.array([0.0, 0.003, 0.001]))
    carrier = Paced()
    record = run(Mounted(carrier, SEEKER), SWEEP, rng=1, options=RunOptions(clock=clock))
    assert np.array_equal(record.outputs[0].time, record.inputs[0].time)
    assert not np.array_equal(record.outputs[0].time, SWEEP.time)
    assert carrier.clock is clock


def test_the_table_and_the_seeker_with_20_ms_between_their_clocks():
    """One run: the table's model is that of the table alone, the seeker's that of the seeker."""
    table = MotionTable(mode="P")
    seeker = CarriedSensor(SEEKER, fs=230.0, clock_offset=0.020, clock_drift=5e-5)
    sweep = design(
        band=(0.5, 40), duration=5, fs=1000, axis="yaw",
        limits=table.limits_of("yaw", travel=3.0, share=0.9),
    )  # fmt: skip
    record = run(Mounted(table, seeker), sweep, rng=1)
    assert [c.name for c in record.outputs] == ["yaw.position", "angle"]
    unit = identify(record.with_roles(inputs=["yaw.position"], outputs=["angle"]))
    parameters = unit["angle", "yaw.position"].parameters
    for name, truth in TRUTH.items():
        assert near(getattr(parameters, name), truth, at_least=0.004 * truth), name
    assert near(parameters.bias, 0.2)
    table_only = record.with_roles(inputs=["yaw.command"], outputs=["yaw.position"])
    linear = {"structures": PLAIN, "nonlinear": "reported"}  # the same question to both
    together = identify(table_only, **linear)
    alone = identify(run(table, sweep, rng=1), **linear)
    pairs = [r["yaw.position"] for r in (together, alone)]
    assert pairs[0].structure == pairs[1].structure  # one model of both, whichever fits
    for name, most in (("bandwidth_phase90", 0.05), ("delay", 5e-5)):  # Hz, s
        one, other = (getattr(pair.parameters, name) for pair in pairs)
        apart = abs(one.value - other.value)
        assert apart < min(4.0 * np.hypot(one.spread, other.spread), most), name
    (clocks,) = [f.message for f in record.findings if f.code == "clocks"]
    assert float(clocks.split("is ")[1].split(" s")[0]) == pytest.approx(0.020, abs=2e-5)
    assert float(clocks.split("gains ")[1].split(" ppm")[0]) == pytest.approx(50, abs=1.5)


@pytest.mark.parametrize(
    ("offset", "drift"),
    [(-3600.0, -5e-5), *in_studies((0.020, 0.0), (0.020, -5e-5), (-3600.0, 0.0))],
)
def test_the_units_clock_does_not_matter(offset, drift):
    seeker = CarriedSensor(SEEKER, fs=300.0, clock_offset=offset, clock_drift=drift)
    record = run(Mounted(Axis(), seeker), SWEEP, rng=3)
    apart = record.channel("angle").time - np.arange(record.channel("angle").values.size) / 300.0
    assert np.abs(apart).max() < 1e-4
    same = run(Mounted(Axis(), CarriedSensor(SEEKER, fs=300.0)), SWEEP, rng=3)
    assert np.array_equal(record.channel("angle").values, same.channel("angle").values)


def test_the_sensor_on_a_carrier_is_the_sensor():
    """Stepped as it goes, against the whole motion at once, to a part in ten thousand."""
    quiet = Sensor(**TRUTH, bias=0.2, output_name="angle")
    record = run(Mounted(Axis(), CarriedSensor(quiet, on_the_way=0.0, jitter=0.0)), SWEEP)
    alone = run(quiet, SWEEP)
    angle = record.channel("angle")
    expected = np.interp(angle.time, alone.outputs[0].time, alone.outputs[0].values)
    assert angle.values.size > 0.97 * SWEEP.samples
    assert np.abs(angle.values - expected).max() < 3e-4 * 3.3


def test_an_unknown_time_on_the_way_counts_as_delay_and_that_is_said():
    seeker = CarriedSensor(SEEKER, fs=300.0, clock_offset=0.02, on_the_way=0.005, states_way=False)
    record = run(Mounted(Axis(), seeker), SWEEP, rng=3)
    result = identify(record.with_roles(inputs=["yaw.position"], outputs=["angle"]))
    delay = result["angle", "yaw.position"].parameters.delay
    assert delay.value == pytest.approx(0.017, abs=2e-4)
    (clocks,) = [f.message for f in record.findings if f.code == "clocks"]
    assert (
        "cannot be measured from stamps that come one way, so it counts as part of the unit's"
        in clocks
    )


def test_a_sensor_itself_may_be_carried():
    record = run(Mounted(Axis(), Sensor(scale_factor=2.0)), SWEEP)
    y = record.channel("y")
    assert np.abs(y.values - 2 * np.interp(y.time, SWEEP.time, SWEEP.position)).max() < 0.01


def test_it_is_a_rig_and_both_are_stopped_and_left():
    axis, told = Axis(), []

    class Unit(CarriedSensor):
        def stop(self):
            told.append("stop")

        def __exit__(self, *_):
            told.append("exit")

        def read(self, now, moved):
            if now > 1.0:
                raise OSError("no data")
            return super().read(now, moved)

    rig = Mounted(axis, Unit(SEEKER))
    assert isinstance(rig, Rig)
    assert (rig.name, rig.axes, rig.limits) == ("seeker on axis", ("yaw",), LIMITS)
    with pytest.raises(RigError, match="rig 'seeker on axis' failed: OSError: no data"):
        run(rig, SWEEP)
    assert axis.told == ["enter", "prepare", "stop", "exit"]
    assert told == ["stop", "exit"]


@pytest.mark.parametrize(
    ("carrier", "unit", "words"),
    [
        (Axis(layout=False), CarriedSensor(SEEKER), "'axis' does not say what it records"),
        (
            Axis(),
            CarriedSensor(SEEKER, axis="roll"),
            "sees axis 'roll', and the carrier mea",
        ),
        (Axis(("yaw", "roll")), CarriedSensor(SEEKER), "sees axis None, .* yaw, roll; state axis"),
        (
            Axis(),
            CarriedSensor(Sensor(output_name="yaw.position")),
            "has the name of one of 'ax",
        ),
    ],
)
def test_what_does_not_fit_is_refused_before_it_moves(carrier, unit, words):
    with pytest.raises(RigError, match=words):
        run(Mounted(carrier, unit), SWEEP)
    assert carrier.told[-2:] == ["stop", "exit"]


def test_what_cannot_be_mounted():
    with pytest.raises(ArgumentError, match="is not a rig, so it carries nothing"):
        Mounted(abs, SEEKER)
    with pytest.raises(ArgumentError, match="is not a unit that can be carried"):
        Mounted(Axis(), Axis())
    with pytest.raises(ArgumentError, match=r"hold_period = 0\.1 .* are not simulated on a"):
        CarriedSensor(Sensor(hold_period=0.1))
    with pytest.raises(ArgumentError, match=r"jitter = -1\.0 s must be 0 or positive"):
        CarriedSensor(SEEKER, jitter=-1.0)
    with pytest.raises(ArgumentError, match=r"fs = 0\.0 Hz must be positive"):
        CarriedSensor(SEEKER, fs=0.0)


@pytest.mark.parametrize("drift", [0.0, 5e-5, -2e-3])
def test_one_way_clocks_are_found_to_the_luck_of_the_fastest(drift):
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(40):
        run_time = np.arange(3000) / 300.0
        arrived = run_time + 0.004 + rng.exponential(0.002, 3000)
        fit = fit_one_way(7.0 + (1 + drift) * run_time, arrived, on_the_way=0.004)
        errors.append(fit(7.0 + (1 + drift) * run_time) - run_time)
    # The fastest of 3000 takes 0.002 / 3000 s more than the shortest; at the ends more.
    assert 0 < np.mean(errors) < 2e-5
    assert np.abs(errors).max() < 2e-4
    exact = fit_one_way(7.0 + (1 + drift) * run_time, run_time + 0.004, on_the_way=0.004)
    assert np.allclose(exact(7.0 + (1 + drift) * run_time), run_time, atol=1e-9)


def test_samples_are_stamped_by_the_unit_until_the_end():
    """What subscribers see is the unit's own clock; the record has the run's."""
    seen = []
    seeker = CarriedSensor(SEEKER, clock_offset=100.0)
    record = run(Mounted(Axis(), seeker), SWEEP, rng=1, subscribers=[
        lambda played: seen.append(played.samples.get("angle", Samples(time=[], values=[])).time)
    ])  # fmt: skip
    stamps = np.concatenate(seen)
    assert stamps[0] == pytest.approx(100.0)
    assert np.allclose(record.channel("angle").time, stamps - 100.0, atol=1e-4)
