"""What a campaign asks of a rig, and the three rigs that a plan can name."""

import importlib
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from hmpim.campaign.case import Case
from hmpim.campaign.plan import AxisWish, Plan
from hmpim.errors import ArgumentError, HmpimError, LimitsError, RigError
from hmpim.experiment import run
from hmpim.record import Record
from hmpim.rigs.table import (
    AXES,
    AxisName,
    MotionTable,
    both_loads,
    exact_bandwidth,
    linear_response,
)
from hmpim.stimulus import Limits, Stimulus, check_inside

__all__ = ["CampaignRig", "Player", "make_rig"]


class Player(Protocol):
    """A rig of one's own: plays the stimuli of a case, all at once.

    The record's channels are named ``AXIS.command`` and ``AXIS.position``.
    """

    def __call__(self, case: Case, stimuli: Sequence[Stimulus], rng: np.random.Generator) -> Record:
        """Move the axes (`Stimulus.axis`) and return what went in and came out."""
        ...


class CampaignRig(Protocol):
    """What a campaign needs."""

    def limits(self, case: Case, wish: AxisWish) -> Limits:
        """Limits of an axis, its travel as wished."""
        ...

    def check(self, case: Case, stimuli: Sequence[Stimulus]) -> dict[str, float]:
        """Refuse what the rig may not do; nothing moves.

        Returns the largest share of its torque that each axis will take, where it is known.
        """
        ...

    def play(self, case: Case, stimuli: Sequence[Stimulus], rng: np.random.Generator) -> Record:
        """Move all axes of the stimuli at once."""
        ...

    def known(self, case: Case, axis: str) -> dict[str, float]:
        """What the physics say; empty if unknown.

        `exact_bandwidth` (Hz) is what is identified, `exact_samples_bandwidth` that of samples
        over samples, `inertia` in kg·m².
        """
        ...

    def coupling(
        self, case: Case, source: str, target: str, frequency: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Gain from the command of `source` to the position of `target`; None if unknown."""
        ...


def make_rig(plan: Plan, *, player: Player | None = None) -> CampaignRig:
    """Return the rig that a plan names.

    Parameters
    ----------
    plan : Plan
        For its `rig` and its axes.
    player : Player, optional
        Takes the place of the plan's entry where the rig is of kind 'python'.

    Raises
    ------
    RigError
        If the plan's entry cannot be imported.

    Examples
    --------
    >>> from hmpim.campaign.plan import read_plan
    >>> from hmpim.campaign.shipped import shipped_plan
    >>> plan = read_plan(shipped_plan("example"))
    >>> from hmpim.campaign.cases import expand
    >>> make_rig(plan).limits(expand(plan)[1], plan.axis("outer")).position
    5.0
    """
    if player is not None or plan.rig.kind == "python":
        return PlayedRig(plan=plan, player=player or _imported(plan.rig.entry, plan.folder))
    if plan.rig.kind == "sensor":
        return PlayedRig(plan=plan, player=_sensors(plan))
    return TableRig(
        table=MotionTable(friction=plan.rig.friction, encoder_noise_std=plan.rig.encoder_noise_std)
    )


def _imported(entry: str, folder: str) -> Player:
    """Import a function by its name, from the plan's own folder too."""
    module, _, name = entry.partition(":")
    try:
        with _beside(folder):
            found = getattr(importlib.import_module(module), name)
    except Exception as error:  # a module of one's own may raise anything
        raise RigError(
            f"rig.entry = {entry!r} cannot be imported: {type(error).__name__}: {error}; it must "
            "name a function that Python finds from here or in the folder of the plan"
        ) from error
    if not callable(found):
        raise RigError(f"rig.entry = {entry!r} is {found!r}; it must name a function")
    return cast(Player, found)


@contextmanager
def _beside(folder: str) -> Iterator[None]:
    """Have the modules of a folder found first, whatever others of their names are loaded."""
    if not folder:
        yield
        return
    place = Path(folder).resolve()
    own = {p.stem for p in place.glob("*.py")} | {
        p.parent.name for p in place.glob("*/__init__.py")
    }
    others = {name for name in own if _is_elsewhere(name, place)}
    aside = {n: m for n, m in sys.modules.items() if n.partition(".")[0] in others}
    for name in aside:
        del sys.modules[name]
    sys.path.insert(0, str(place))
    try:
        yield
    finally:
        sys.path.remove(str(place))
        for name in [n for n in sys.modules if n.partition(".")[0] in others]:
            del sys.modules[name]
        sys.modules.update(aside)


def _is_elsewhere(name: str, place: Path) -> bool:
    file = getattr(sys.modules.get(name), "__file__", None)
    return file is not None and place not in Path(file).resolve().parents


def _wished(limits: Limits, wish: AxisWish) -> Limits:
    if wish.travel is None:
        return limits
    if wish.travel > limits.position:
        raise LimitsError(
            f"travel = {wish.travel:g} {limits.unit} is more than the {limits.position:g} "
            f"{limits.unit} that {wish.name} has; ask for less"
        )
    return replace(limits, position=wish.travel)


def _own(wish: AxisWish) -> Limits:
    if wish.limits is None:
        raise ArgumentError(f"axes.{wish.name}.limits is missing; give it")
    return _wished(wish.limits, wish)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRig:
    """The five-axis table."""

    table: MotionTable

    def loaded(self, case: Case) -> MotionTable:
        """Return the table as a case wants it; 'a+b' is a on the inner axes, b on the outer."""
        inner, outer = both_loads(case.load)
        return replace(self.table, uut_load=inner, target_load=outer, mode=case.mode)

    def limits(self, case: Case, wish: AxisWish) -> Limits:
        """As Fig. 4."""
        return _wished(self.loaded(case).limits_of(cast(AxisName, wish.name)), wish)

    def check(self, case: Case, stimuli: Sequence[Stimulus]) -> dict[str, float]:
        """Limits of each axis, and the torque that all together take."""
        table = self.loaded(case)
        torque = table.check({cast(AxisName, s.axis): s for s in stimuli})
        limit = np.array([axis.torque_limit for axis in table.specs])
        share = np.abs(torque).max(axis=0) / limit
        return dict(zip(AXES, share.tolist(), strict=True))

    def play(self, case: Case, stimuli: Sequence[Stimulus], rng: np.random.Generator) -> Record:
        """Simulate."""
        return run(self.loaded(case), stimuli, rng=rng)

    def known(self, case: Case, axis: str) -> dict[str, float]:
        """Of the linearised mechanics, friction off."""
        table, name = self.loaded(case), cast(AxisName, axis)
        inertia = table.plant.inertia(table.start_angles)[AXES.index(name)]
        return {
            "exact_bandwidth": exact_bandwidth(table, axis=name, fs=case.rate),
            "exact_samples_bandwidth": exact_bandwidth(
                table, axis=name, fs=case.rate, hold="included"
            ),
            "inertia": float(inertia),
        }

    def coupling(
        self, case: Case, source: str, target: str, frequency: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Of the linearised mechanics, samples over samples, friction off."""
        response = linear_response(
            self.loaded(case),
            frequency,
            axis_in=cast(AxisName, source),
            axis_out=cast(AxisName, target),
            fs=case.rate,
            hold="included",
        )
        return np.abs(response)


def _sensors(plan: Plan) -> Player:
    """Play on the simulated sensor that the plan gives each axis."""

    def play(case: Case, stimuli: Sequence[Stimulus], rng: np.random.Generator) -> Record:
        (stimulus,) = stimuli
        sensor = plan.axis(stimulus.axis).sensor
        if sensor is None:
            raise ArgumentError(f"axes.{stimulus.axis}.sensor is missing; give it")
        named = replace(
            sensor,
            input_name=f"{stimulus.axis}.command",
            output_name=f"{stimulus.axis}.position",
        )
        return run(named, stimulus, rng=rng)

    return play


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedRig:
    """Anyone's rig, behind one function; its limits are those that the plan states."""

    plan: Plan
    player: Player

    def limits(self, case: Case, wish: AxisWish) -> Limits:
        """As the plan says."""
        return _own(wish)

    def check(self, case: Case, stimuli: Sequence[Stimulus]) -> dict[str, float]:
        """Limits of the plan: what moves on a rig is looked at once more."""
        for stimulus in stimuli:
            wish = self.plan.axis(stimulus.axis, test=case.test)
            check_inside(stimulus, _own(wish), whose=repr(stimulus.axis))
        return {}

    def play(self, case: Case, stimuli: Sequence[Stimulus], rng: np.random.Generator) -> Record:
        """Call the function, and look at what it returns."""
        try:
            record = self.player(case, stimuli, rng)
        except HmpimError:
            raise
        except Exception as error:  # a driver may raise anything
            raise RigError(
                f"the rig failed in case {case.id}: {type(error).__name__}: {error}"
            ) from error
        if not isinstance(record, Record):
            raise RigError(f"the rig returned {type(record).__name__}; it must be a Record")
        there = {channel.name for channel in (*record.inputs, *record.outputs)}
        for axis in case.axes:
            for name in (f"{axis}.command", f"{axis}.position"):
                if name not in there:
                    raise RigError(
                        f"the rig's record of case {case.id} has no channel {name!r}, only "
                        f"{', '.join(sorted(there))}"
                    )
        return record

    def known(self, case: Case, axis: str) -> dict[str, float]:
        """Nobody knows."""
        return {}

    def coupling(
        self, case: Case, source: str, target: str, frequency: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Nobody knows."""
        return None
