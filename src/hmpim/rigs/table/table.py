"""A five-axis flight motion simulator (section II, Fig. 4) as a rig."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, LimitsError
from hmpim.rigs.block import Block, ChannelSpec, Layout, Quantity, Samples
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.table.axes import AXES, FIG_4, AxisName, AxisSpec, CommandMode, TablePosition
from hmpim.rigs.table.bodies import Base, LoadName, Rigid, load_named
from hmpim.rigs.table.checks import check_torques
from hmpim.rigs.table.commands import by_axis, command_rate, commands, place, spread
from hmpim.rigs.table.plant import Plant, build
from hmpim.rigs.table.servo import Gains
from hmpim.rigs.table.simulate import History, Motion, Timing
from hmpim.rigs.table.tuning import tune
from hmpim.stimulus import Limits, check_inside
from hmpim.units import conversion_factor, rate_unit

__all__ = ["MotionTable"]

FloatArray = NDArray[np.float64]

_BESIDE: tuple[Quantity, ...] = ("velocity", "acceleration")
_MIDDLE = TablePosition()
_BLOCK = Base()
_TUNED_AT = 1000.0  # Hz, the command rate at which Fig. 4's bandwidths hold


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionTable(Simulated):
    """A simulated five-axis motion table: rigid bodies in MuJoCo, a digital servo on each axis.

    Commands come at the stimulus's rate and are held in between. Roll, yaw and pitch carry the
    unit under test, azimuth and elevation the target; both sets stand on one base.

    Parameters
    ----------
    specs : tuple of AxisSpec
        The five axes in the order of `AXES`; those of Fig. 4 by default.
    uut_load, target_load : str or Rigid
        What the inner and the outer axes carry: 'acceptance', 'none', 'bracket' (inner only),
        'projector' (outer only), or a body of your own.
    mode : {'P', 'PV', 'PVA'}
        Which commands are sent: position; and velocity; and acceleration.
    friction : bool
        False takes dry and viscous friction away.
    start : TablePosition
        Where the axes stand before a run; stimuli count from there.
    base : Base
        The block underneath.
    controller_rate : float
        Ticks of the servos per second, Hz; the stimulus's rate must divide it.
    delay : float
        Transport of a command to the servo, s; it takes force at the next tick.
    supply : float
        Share of the rated torques that the oil's pressure really gives, more than 0 and at most
        1. Checks know the rating alone. A weak supply lowers the bandwidth at large levels,
        where friction lowers it at small ones.
    encoder_resolution : float
        Step of the encoders, deg.
    encoder_noise_std : float
        White noise of each encoder before it is rounded, deg.
    realtime : bool
        True keeps pace with the clock on the wall.
    observe : tuple of str or None
        Axes whose encoders are recorded; None for those that move.
    name : str
        Name of the rig.

    Raises
    ------
    ArgumentError
        If a value is out of range.
    MissingExtraError
        On use, if MuJoCo is not installed.

    Examples
    --------
    >>> from hmpim.stimulus import design
    >>> table = MotionTable(mode="PV")
    >>> limits = table.limits_of("pitch", travel=2.0)
    >>> sweep = design(band=(0.5, 30), duration=1, fs=500, limits=limits)
    >>> from hmpim.experiment import run
    >>> record = run(table, {"pitch": sweep}, rng=0)
    >>> record.inputs[0].name, record.outputs[0].name, record.intersample
    ('pitch.command', 'pitch.position', 'feedforward')
    """

    specs: tuple[AxisSpec, ...] = FIG_4
    uut_load: LoadName | Rigid = "acceptance"
    target_load: LoadName | Rigid = "acceptance"
    mode: CommandMode = "P"
    friction: bool = True
    start: TablePosition = _MIDDLE
    base: Base = _BLOCK
    controller_rate: float = 2000.0
    delay: float = 1e-3
    supply: float = 1.0
    encoder_resolution: float = 0.003
    encoder_noise_std: float = 0.0005
    realtime: bool = False
    observe: tuple[AxisName, ...] | None = None
    name: str = "table"
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        names = tuple(axis.name for axis in self.specs)
        if names != AXES:
            raise ArgumentError(f"specs are of {names}; give the five of {AXES}, in this order")
        if self.mode not in ("P", "PV", "PVA"):
            raise ArgumentError(f"mode = {self.mode!r} is not known; use 'P', 'PV' or 'PVA'")
        for name in ("controller_rate", "encoder_resolution"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} = {value!r} must be positive and finite")
        for name in ("delay", "encoder_noise_std"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ArgumentError(f"{name} = {value!r} must be 0 or positive, and finite")
        if not 0.0 < self.supply <= 1.0:
            raise ArgumentError(f"supply = {self.supply!r} must be more than 0 and at most 1")
        load_named("uut", self.uut_load)
        load_named("target", self.target_load)
        for axis in self.observe or ():
            place(axis)
        for axis in AXES:
            self.limits_of(axis)

    @property
    def follows_commands(self) -> bool:
        """True: each block is played as it comes."""
        return True

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the five axes."""
        return AXES

    @property
    def limits(self) -> dict[str, Limits]:
        """Of each axis, from where it starts, see `limits_of`."""
        return {axis: self.limits_of(axis) for axis in AXES}

    def limits_of(
        self, axis: AxisName, *, travel: float | None = None, share: float = 1.0
    ) -> Limits:
        """What an axis may be commanded, from where it starts; what a stimulus is designed in.

        Parameters
        ----------
        axis : str
            One of `AXES`.
        travel : float or None
            Largest position wanted, deg; None for all that is left. A sweep that has to fill
            the whole travel is seldom possible within the rate limit.
        share : float
            Share of the limits on rate, acceleration and jerk to use, at most 1.

        Raises
        ------
        ArgumentError
            If there is no such axis, or a share above 1.
        LimitsError
            If the start leaves no travel, or less than wanted.

        Examples
        --------
        >>> MotionTable(start=TablePosition(yaw=30.0)).limits_of("yaw").position
        25.0
        >>> MotionTable().limits_of("elevation", travel=3.0, share=0.5).acceleration
        450.0
        """
        limits = self.specs[place(axis)].limits.to("deg")
        at = getattr(self.start, axis)
        left = limits.position - abs(at)
        if left <= 0.0 or (travel is not None and travel > left):
            wanted = "" if travel is None else f", less than the {travel:g} deg wanted"
            raise LimitsError(
                f"start of {axis} = {at:g} deg leaves {max(left, 0.0):g} deg of travel within "
                f"±{limits.position:g} deg{wanted}; start nearer the middle"
            )
        if not 0.0 < share <= 1.0:
            raise ArgumentError(f"share = {share!r} must be more than 0 and at most 1")
        return Limits(
            position=left if travel is None else travel,
            velocity=share * limits.velocity,
            acceleration=share * limits.acceleration,
            jerk=share * limits.jerk,
            unit="deg",
        )

    @property
    def gains(self) -> Gains:
        """What the servos are tuned to: with the acceptance loads, at 1000 commands a second.

        Examples
        --------
        >>> bool(MotionTable().gains.position[0] > MotionTable().gains.position[4])
        True
        """
        hold = max(1, round(self.controller_rate / _TUNED_AT))
        timing = self.timing(self.controller_rate / hold)
        return tune(
            self.specs, base=self.base, tick=timing.tick, hold=timing.hold, late=timing.late
        )

    @property
    def plant(self) -> Plant:
        """The mechanics with its loads, compiled once."""
        return build(
            self.specs,
            uut=load_named("uut", self.uut_load),
            target=load_named("target", self.target_load),
            base=self.base,
            friction=self.friction,
            tick=1.0 / self.controller_rate,
        )

    @property
    def start_angles(self) -> FloatArray:
        """Where the axes stand before a run, rad, shape (5,)."""
        return np.radians([getattr(self.start, axis) for axis in AXES])

    def timing(self, fs: float) -> Timing:
        """Hold and delay in ticks, for commands at `fs` (Hz).

        Raises
        ------
        ArgumentError
            If `fs` does not divide the controller's rate.

        Examples
        --------
        >>> MotionTable().timing(500.0).hold
        4
        """
        hold = round(self.controller_rate / fs) if fs > 1e-9 * self.controller_rate else 0
        if hold < 1 or abs(hold * fs / self.controller_rate - 1.0) > 1e-9:
            raise ArgumentError(
                f"fs = {fs:g} Hz does not divide the controller's rate "
                f"{self.controller_rate:g} Hz; command at 500 or 1000 Hz, for instance"
            )
        return Timing(
            tick=1.0 / self.controller_rate,
            hold=hold,
            late=math.ceil(self.delay * self.controller_rate - 1e-9),
        )

    def check(self, stimuli: Stimuli) -> FloatArray:
        """Refuse what the table may not do; nothing moves.

        Position, rate and acceleration of each axis first, then the torque that the motion of
        all axes together takes of each (inverse dynamics of what is commanded).

        Returns
        -------
        ndarray, shape (n, 5)
            That torque, N·m, in the order of `AXES`.

        Raises
        ------
        LimitsError
            Names axis, value, limit, and for a torque the time.
        UnitError
            If a stimulus is in no unit of angle.
        ArgumentError
            If an axis is not known, the stimuli differ in rate, or the controller's rate is no
            multiple of theirs.

        Examples
        --------
        >>> from hmpim.stimulus import Sine, Stimulus
        >>> shake = Stimulus(waveform=Sine(frequency=9.0, duration=1.0), fs=500.0, unit="deg")
        >>> MotionTable().check({"elevation": shake})
        Traceback (most recent call last):
        hmpim.errors.LimitsError: peak acceleration 3197.75 deg/s² is beyond the limit ...
        """
        named = by_axis(stimuli)
        self.timing(command_rate(named))
        samples = max(stimulus.samples for stimulus in named.values())
        for axis, stimulus in named.items():
            check_inside(stimulus, self.limits_of(axis), whose=axis, samples=samples)
        time, command = commands(named, start=self.start_angles)
        torque = self.plant.torques(*command)
        check_torques(time, torque, self.specs)
        return torque

    def motion(self, fs: float, *, rng: np.random.Generator) -> Motion:
        """Return the table at rest at its start, ready for commands at `fs` (Hz).

        Nothing is checked: limits are the caller's to keep, see `check`.

        Parameters
        ----------
        fs : float
            Commands a second, Hz.
        rng : numpy.random.Generator
            Source of the encoders' noise.

        Examples
        --------
        >>> table = MotionTable(encoder_noise_std=0.0)
        >>> moved = table.motion(1000.0, rng=np.random.default_rng(0))
        >>> still = np.zeros((3, 5))
        >>> moved.advance(still, still, still).time.tolist()
        [0.0, 0.001, 0.002]
        """
        return Motion(
            self.plant,
            self.specs,
            self.gains,
            start=self.start_angles,
            mode=self.mode,
            timing=self.timing(fs),
            supply=self.supply,
            resolution=math.radians(self.encoder_resolution),
            noise_std=math.radians(self.encoder_noise_std),
            rng=rng,
        )

    def simulate(self, stimuli: Stimuli, *, rng: np.random.Generator) -> History:
        """Play stimuli and return what all five axes did; limits are checked first.

        Parameters
        ----------
        stimuli : Stimulus or mapping of axis to Stimulus
            One, for the axis it names in `Stimulus.axis`, or one for each axis that moves.
        rng : numpy.random.Generator
            Source of the encoders' noise.

        Raises
        ------
        LimitsError
            As `check`.
        RigError
            If an axis runs away.
        """
        self.check(stimuli)
        named = by_axis(stimuli)
        _, command = commands(named, start=self.start_angles)
        return self.motion(command_rate(named), rng=rng).advance(*command)

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Check one axis's stimulus, or those of several at once, and stand at the start.

        Parameters
        ----------
        stimulus : Stimulus or mapping of axis to Stimulus
            One, for the axis it names in `Stimulus.axis`, or one for each axis that moves. All
            have one rate, that of the commands; a shorter one waits at rest for the others.
            Axes without a stimulus are held where they start.

        Returns
        -------
        Layout
            Inputs ``roll.command`` and so on, outputs ``roll.position``, both from the start
            position, in the stimulus's unit (outputs of axes held: deg). Held between samples in
            mode P; in PV and PVA velocity and acceleration are held too, and the record says
            'feedforward'. The velocity commands of PV, and the acceleration commands of PVA, are
            auxiliary: ``roll.velocity_command`` and so on.

        Raises
        ------
        LimitsError
            If an axis would leave its limits, or all together take too much torque of one;
            nothing has moved then.

        Examples
        --------
        >>> from hmpim.experiment import run
        >>> from hmpim.stimulus import design
        >>> table = MotionTable()
        >>> limits = table.limits_of("roll", travel=5.0)
        >>> sweep = design(band=(1, 50), duration=1, fs=1000, limits=limits, axis="roll")
        >>> run(table, sweep).outputs[0].unit
        'deg'
        """
        named = by_axis(stimulus)
        seen = tuple(named) if self.observe is None else self.observe
        self.check(stimulus)
        units = {axis: named[axis].unit if axis in named else "deg" for axis in seen}
        self._playing.state = (
            self.motion(command_rate(named), rng=self._playing.take_rng()),
            {axis: conversion_factor("deg", to=unit) for axis, unit in units.items()},
        )
        inputs = [
            ChannelSpec(
                name=f"{axis}.command",
                role="input",
                unit=s.unit,
                axis=axis,
                quantity="position",
            )
            for axis, s in named.items()
        ]
        outputs = [
            ChannelSpec(
                name=f"{axis}.position", role="output", unit=unit, axis=axis, quantity="position"
            )
            for axis, unit in units.items()
        ]
        feedforward = [
            ChannelSpec(
                name=f"{axis}.{quantity}_command",
                role="auxiliary",
                unit=rate_unit(s.unit, order),
                axis=axis,
                quantity=quantity,
                commanded=True,
            )
            for axis, s in named.items()
            for order, quantity in enumerate(_BESIDE[: len(self.mode) - 1], start=1)
        ]
        return Layout(
            channels=(*inputs, *outputs, *feedforward),
            intersample="zoh" if self.mode == "P" else "feedforward",
            source=f"simulated {self.name}, {self.mode}",
        )

    def play(self, block: Block, /) -> dict[str, Samples]:
        """Move as commanded, and read the encoders.

        Raises
        ------
        RigError
            If an axis runs away.
        """
        motion, factors = self._playing.current(self.name)
        if self.realtime:
            for _ in block.due():
                pass
        still = np.zeros(5)
        history = motion.advance(
            spread(block.position, block.axes, block.units, around=self.start_angles),
            spread(block.velocity, block.axes, block.units, around=still),
            spread(block.acceleration, block.axes, block.units, around=still),
        )
        # Stamped with the time of the simulation, whatever the clock on the wall does.
        samples: dict[str, Samples] = {}
        for axis in block.axes:
            samples[f"{axis}.command"] = Samples(time=block.time, values=block.of(axis))
            for quantity in _BESIDE[: len(self.mode) - 1]:
                sent = block.of(axis, quantity)
                samples[f"{axis}.{quantity}_command"] = Samples(time=block.time, values=sent)
        for axis, factor in factors.items():
            read = history.of(axis, "encoder") - getattr(self.start, axis)
            samples[f"{axis}.position"] = Samples(time=block.time, values=factor * read)
        return samples
