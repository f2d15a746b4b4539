"""The families: each a name, a sentence, and how one draw of it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from families import conditions as c
from families import kinds as k
from families.noise import Noise, pink, wander
from families.take import Draw, Take, finish, shoot

__all__ = ["FAMILIES", "Family"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Records of one sort.

    Parameters
    ----------
    name, words : str
        How it is called, and what it is.
    draw : callable
        Makes one draw from a random generator.
    one_sided : bool
        Whether its interval is a hull or one-sided by design: 93 % are needed, and no upper end.
    most : int
        Draws it takes at most; 0 for as many as are asked for.
    """

    name: str
    words: str
    draw: Callable[[np.random.Generator], Draw]
    one_sided: bool = False
    most: int = 0


def family(
    name: str,
    words: str,
    system: k.MakeSystem,
    drive: k.MakeDrive,
    *spoil: c.Condition,
    snr: tuple[float, float] = (25.0, 60.0),
    colour: Callable[[np.random.Generator, int], Noise] | None = None,
    start: float = 0.0,
    adjust: Callable[[Take], None] | None = None,
    change: Callable | None = None,
    one_sided: bool = False,
    most: int = 0,
) -> Family:
    """A linear system under an input, and what spoils the record.

    `snr` in dB, r.m.s. motion to noise; `start` as a share of the input's length; `change`
    takes the generator, the system and the drive and returns another system.
    """

    def draw(rng: np.random.Generator) -> Draw:
        signal = drive(rng)
        unit = system(rng, signal)
        if change is not None:
            unit = change(rng, unit, signal)
        made = None if colour is None else colour(rng, signal.samples)
        begin = np.round(start * signal.samples) / signal.fs
        take = shoot(
            rng, unit, signal, snr_db=float(rng.uniform(*snr)), colour=made, start=float(begin)
        )
        for condition in spoil:
            condition(take)
        return finish(take)

    return Family(name=name, words=words, draw=draw, one_sided=one_sided, most=most)


def delayed(low: float, high: float):
    """A delay between two shares of the record."""

    def change(rng: np.random.Generator, unit: k.System, drive: k.Drive) -> k.System:
        vector = unit.vector()
        vector[0] = float(rng.uniform(low, high)) * drive.duration
        return unit.moved(vector)

    return change


def ahead(rng: np.random.Generator, unit: k.System, drive: k.Drive) -> k.System:
    vector = unit.vector()
    vector[0] = -float(rng.uniform(0.02, 0.5))
    return unit.moved(vector)


SECOND = k.second_order()

ALL = (
    family("static", "A gain and a delay under a sweep", k.static, k.sweep()),
    family("first order", "One lag under a sweep", k.first_order, k.sweep()),
    family("second order", "ζ 0.15 to 1.4 under a sweep", SECOND, k.sweep()),
    family("light damping", "ζ 0.02 to 0.1", k.second_order(0.02, 0.1), k.sweep()),
    family("heavy damping", "ζ 1.5 to 6", k.second_order(1.5, 6.0), k.sweep()),
    family("Butterworth", "Order 2 to 6", k.low_pass("butterworth"), k.sweep()),
    family("Bessel", "Order 2 to 6", k.low_pass("bessel"), k.sweep()),
    family("lead", "A zero below its pole", k.lead, k.sweep()),
    family("lead-lag", "Two zeros between two poles", k.lead_lag, k.sweep()),
    family("non-minimum phase", "A zero on the right", k.non_minimum_phase, k.sweep()),
    family("notch", "A narrow notch in a second-order lag", k.notch, k.sweep()),
    family("anti-resonance", "A dip between two modes", k.anti_resonance, k.sweep()),
    family("two modes", "In parallel", k.modes(2, 2), k.sweep()),
    family("integrator", "With a gain and a delay", k.integrator, k.sweep()),
    family("washout", "Zero at DC", k.washout, k.sweep()),
    family("differentiator", "Behind a second-order lag", k.differentiator, k.sweep()),
    family("lag behind a resonance", "A third pole", k.lag_behind_resonance, k.sweep()),
    family("white held", "White, held at the rate", SECOND, k.sequence("white")),
    family("PRBS held", "Clocked slower than the rate", SECOND, k.sequence("prbs")),
    family("white", "Band-limited, moving before the record", SECOND, k.lines()),
    family("step", "One step, held", SECOND, k.shaped("step")),
    family("doublet", "Held", SECOND, k.shaped("doublet")),
    family("3-2-1-1", "Held", SECOND, k.shaped("3211")),
    family("one sine", "One line, already going", SECOND, k.sines(1)),
    family("mid-sweep", "The record begins in the sweep", SECOND, k.sweep(), start=0.25),
    family(
        "AR(0.99)",
        "Strongly coloured noise",
        SECOND,
        k.sweep(samples=3000),
        colour=lambda rng, n: wander(0.99),
    ),
    family("1/f", "Pink noise", SECOND, k.sweep(samples=3000), colour=lambda rng, n: pink(n)),
    family("noisy", "-10 to 10 dB", SECOND, k.sweep(), snr=(-10, 10)),
    family(
        "output at 1e7", "A bias of ten million", SECOND, k.sweep(), c.operating_point(both=False)
    ),
    family("both at 1e7", "Input and output", SECOND, k.sweep(), c.operating_point(both=True)),
    family("ahead", "Delay -0.5 s to -0.02 s", SECOND, k.sweep(), change=ahead),
)

FAMILIES = {f.name: f for f in ALL}
