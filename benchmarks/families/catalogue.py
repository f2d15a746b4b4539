"""The families: each a name, a sentence, and how one draw of it is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from families import conditions as c
from families import kinds as k
from families import made as m
from families.noise import Noise, pink, vibration, wander, white
from families.take import Draw, finish, shoot

__all__ = ["FAMILIES", "Family", "named"]

Change = Callable[[np.random.Generator, k.System, k.Drive], k.System]


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """Records of one sort.

    Parameters
    ----------
    name, words : str
        How it is called, and what it is.
    draw : callable
        Makes one draw from a random generator.
    most : int
        Draws it takes at most; 0 for as many as are asked for.
    """

    name: str
    words: str
    draw: Callable[[np.random.Generator], Draw]
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
    change: Change | None = None,
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
        skipped = round(start * signal.samples)
        if skipped:
            low, high = signal.band
            band = (low + start * (high - low), high)
            signal = replace(signal, samples=signal.samples - skipped, band=band)
        begin = skipped / signal.fs
        take = shoot(rng, unit, signal, snr_db=float(rng.uniform(*snr)), colour=made, start=begin)
        for condition in spoil:
            condition(take)
        return finish(take)

    return Family(name=name, words=words, draw=draw, most=most)


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


def short_sweep(rng: np.random.Generator) -> k.Drive:
    return k.sweep(samples=int(rng.integers(50, 121)))(rng)


def shaking(rng: np.random.Generator, _samples: int) -> Noise:
    """Inside the band of most sweeps; 80 % of the power."""
    return vibration(k.log_uniform(rng, 0.01, 0.08), 0.002, 0.8)


def slow_disturbance(rng: np.random.Generator) -> Noise:
    return wander(float(rng.uniform(0.9, 0.99)))


def other(name: str, words: str, draw: m.Make) -> Family:
    return Family(name=name, words=words, draw=draw)


SECOND, FIRST = k.second_order(), k.first_order
SWEEP = k.sweep()
MIDDLE = k.sweep(samples=2000)

SYSTEMS = (
    family("static", "A gain and a delay", k.static, SWEEP),
    family("first order", "One lag", FIRST, SWEEP),
    family("second order", "ζ 0.15 to 1.4", SECOND, SWEEP),
    family("light damping", "ζ 0.02 to 0.1", k.second_order(0.02, 0.1), SWEEP),
    family("heavy damping", "ζ 1.5 to 6", k.second_order(1.5, 6.0), SWEEP),
    family("Butterworth", "Order 2 to 6", k.low_pass("butterworth"), SWEEP),
    family("Bessel", "Order 2 to 6", k.low_pass("bessel"), SWEEP),
    family("lead", "A zero below its pole", k.lead, SWEEP),
    family("lead-lag", "Two zeros between two poles", k.lead_lag, SWEEP),
    family("slow tail", "Second order; the last 1 to 6 % settles slowly", k.slow_tail, MIDDLE),
    family("second order with a zero", "In the left half plane", k.with_zero, SWEEP),
    family("non-minimum phase", "A zero in the right half plane", k.non_minimum_phase, SWEEP),
    family("notch", "A narrow one in a second-order lag", k.notch, SWEEP),
    family("anti-resonance", "A dip between two modes", k.anti_resonance, SWEEP),
    family("two modes", "In parallel", k.modes(2, 2), SWEEP),
    family("three or four modes", "In parallel", k.modes(3, 4), MIDDLE),
    family("five to eight modes", "In parallel", k.modes(5, 8), k.sweep(samples=4000)),
    family("integrator", "With a gain and a delay", k.integrator, SWEEP),
    family("integrator with a lag", "One pole more", k.lagging_integrator, SWEEP),
    family("washout", "First order, zero at DC", k.washout, SWEEP),
    family("AC-coupled", "A second-order sensor behind a capacitor", k.ac_coupled, SWEEP),
    family("geophone", "Second-order high pass", k.geophone, SWEEP),
    family("differentiator", "Behind a second-order lag", k.differentiator, SWEEP),
    family("lag behind a resonance", "A third pole", k.lag_behind_resonance, SWEEP),
    family("servo with a zero", "A mode, a lag and a zero", k.servo(1), SWEEP),
    family("servo with two zeros", "A mode, a lag and two zeros", k.servo(2), SWEEP),
)

INPUTS = (
    family(
        "hmpim design", "Second order; the paper's sweep, rest to rest", SECOND, k.designed("hmpim")
    ),
    family("exponential sweep", "Second order; rest to rest", SECOND, k.designed("exponential")),
    family("reversed sweep", "Second order; high to low", SECOND, k.designed("reversed")),
    family("Schroeder design", "Second order; rest to rest", SECOND, k.designed("schroeder")),
    family("random-phase design", "Second order; rest to rest", SECOND, k.designed("random_phase")),
    family("smooth PRBS", "Second order; smooth transitions", SECOND, k.designed("prbs")),
    family("smooth steps", "Second order; smooth transitions", SECOND, k.designed("steps")),
    family(
        "velocity commands",
        "A servo with a zero; command and velocity held",
        k.servo(1),
        k.faded(k.sweep("zoh")),
        c.feedforward,
    ),
    family(
        "acceleration commands",
        "A servo with two zeros; command, velocity and acceleration held; the record states it",
        k.servo(2),
        k.faded(k.sweep("zoh")),
        c.feedforward,
        c.stated,
    ),
    family("held sweep", "Second order; a converter at the rate", SECOND, k.sweep("zoh")),
    family(
        "held sweep, stated", "The same, and the record says so", SECOND, k.sweep("zoh"), c.stated
    ),
    family(
        "sweep, slow converter",
        "Second order; held for 2 to 5 samples",
        SECOND,
        k.slower_clock(k.sweep("zoh")),
    ),
    family("linear sweep", "Second order; straight between the samples", SECOND, k.sweep("foh")),
    family("first order, held sweep", "A converter at the rate", FIRST, k.sweep("zoh")),
    family("PRBS held", "Second order; clocked slower than the rate", SECOND, k.sequence("prbs")),
    family(
        "PRBS at the rate",
        "Second order; it may change at every sample",
        SECOND,
        k.sequence("fast_prbs"),
    ),
    family(
        "two lags, PRBS",
        "ζ 1 to 3, held; the second pole hides as delay",
        k.second_order(1.05, 3.0),
        k.sequence("prbs"),
    ),
    family(
        "Butterworth, PRBS", "Order 2 to 6, held", k.low_pass("butterworth"), k.sequence("prbs")
    ),
    family("lag behind a resonance, PRBS", "Held", k.lag_behind_resonance, k.sequence("prbs")),
    family("white held", "Second order; held at the rate", SECOND, k.sequence("white")),
    family("white", "Second order; band-limited, moving before the record", SECOND, k.lines()),
    family("two modes, white", "Band-limited, moving before the record", k.modes(2, 2), k.lines()),
    family("washout, white", "Band-limited, moving before the record", k.washout, k.lines()),
    family("geophone, PRBS", "Second-order high pass; held", k.geophone, k.sequence("prbs")),
    family("static, PRBS", "Held", k.static, k.sequence("prbs")),
    family("step", "Second order; held", SECOND, k.shaped("step")),
    family("first order, step", "Held", FIRST, k.shaped("step")),
    family("doublet", "Second order; held", SECOND, k.shaped("doublet")),
    family("integrator, doublet", "With a lag; held", k.lagging_integrator, k.shaped("doublet")),
    family("3-2-1-1", "Second order; held", SECOND, k.shaped("3211")),
    family("ramp", "Second order; straight between the samples", SECOND, k.shaped("ramp", "foh")),
    family("impact", "ζ 0.02 to 0.2; one blow of a hammer", k.second_order(0.02, 0.2), k.impact),
    family(
        "human", "Second order; what a hand does", SECOND, k.lines("human", rates=(50.0, 100.0))
    ),
    family("one sine", "Second order; one line, already going", SECOND, k.sines(1)),
    family("four sines", "Second order; already going", SECOND, k.sines(4)),
)

BEGINNINGS = (
    family("mid-sweep", "The record begins in the sweep", SECOND, SWEEP, start=0.25),
    family(
        "mid-sweep, light damping",
        "ζ 0.02 to 0.1; it begins in the sweep",
        k.second_order(0.02, 0.1),
        SWEEP,
        start=0.25,
    ),
    family(
        "ringing", "The output rings from a step before the record", SECOND, k.after_a_step(SWEEP)
    ),
    family(
        "periodic steady state",
        "One to three whole Schroeder periods",
        SECOND,
        k.lines("schroeder", periodic=True),
    ),
    family(
        "output at 1e7", "Output around ten million", SECOND, SWEEP, c.operating_point(both=False)
    ),
    family(
        "both at 1e7",
        "Input and output around ten million",
        SECOND,
        SWEEP,
        c.operating_point(both=True),
    ),
    other("any unit", "Both channels times 1e-100 to 1e100", m.in_units(SECOND, SWEEP)),
    family("ahead", "Delay -0.5 s to -0.02 s", SECOND, SWEEP, change=ahead),
    family("long delay", "A tenth to half of the record", SECOND, SWEEP, change=delayed(0.1, 0.5)),
    family(
        "delay beyond half", "0.5 to 0.8 of the record", SECOND, k.lines(), change=delayed(0.5, 0.8)
    ),
    family("50 to 120 samples", "Second order", SECOND, short_sweep),
    family("100 000 samples", "Second order", SECOND, k.sweep(samples=100_000), most=20),
    family("1 000 000 samples", "Second order", SECOND, k.sweep(samples=1_000_000), most=5),
)

NOISE = (
    family("noisy", "-10 to 10 dB", SECOND, SWEEP, snr=(-10, 10)),
    family("clean", "80 to 120 dB", SECOND, SWEEP, snr=(80, 120)),
    family("no noise", "200 to 280 dB: rounding alone", SECOND, SWEEP, snr=(200, 280)),
    family(
        "no noise, held",
        "The same behind a converter at the rate, a binary sequence",
        SECOND,
        k.sequence("prbs"),
        snr=(200, 280),
    ),
    family(
        "clean and held",
        "80 to 120 dB; a converter at the rate",
        SECOND,
        k.sweep("zoh"),
        snr=(80, 120),
    ),
    family(
        "AR(0.99)",
        "Strongly coloured noise",
        SECOND,
        MIDDLE,
        colour=lambda rng, n: wander(0.99),
        snr=(10, 50),
    ),
    family("1/f", "Pink noise", SECOND, MIDDLE, colour=lambda rng, n: pink(n), snr=(10, 50)),
    family("mains", "Hum of 50 or 60 Hz", SECOND, MIDDLE, c.mains),
    family(
        "vibration",
        "A narrow band of noise inside the swept band",
        SECOND,
        MIDDLE,
        colour=shaking,
        snr=(15, 40),
    ),
    family(
        "louder noise",
        "Over a part of the record, or the faster the output moves",
        SECOND,
        SWEEP,
        c.louder,
    ),
    family("spikes", "One sample in two hundred far out", SECOND, SWEEP, c.spikes),
    family("missing", "One row in twenty is not there", SECOND, SWEEP, c.missing),
    family("jitter", "The clock's stamps jitter by 5 %", SECOND, SWEEP, c.jitter),
    family("stamped on arrival", "Even samples, stamps late by chance", SECOND, SWEEP, c.arrival),
    family("drift", "The bias moves steadily", SECOND, SWEEP, c.drift("steady")),
    family("thermal", "The bias warms up", SECOND, SWEEP, c.drift("thermal")),
    family("noise on the input", "0.3 to 3 %", SECOND, SWEEP, c.input_noise),
    family(
        "held, noise on the input", "0.3 to 3 %, PRBS", SECOND, k.sequence("prbs"), c.input_noise
    ),
    family(
        "dropped frames",
        "3 % of the samples repeat the one before",
        SECOND,
        SWEEP,
        c.repeated_frames,
    ),
    family("late frames", "The delay jitters by a tenth of a sample", SECOND, SWEEP, c.late_frames),
    family("quantised", "Rounded", SECOND, SWEEP, c.quantised),
    family("clipped", "5 to 30 % beyond one end", SECOND, SWEEP, c.clipped(both=False)),
    family("clipped twice", "5 to 30 % beyond each end", SECOND, SWEEP, c.clipped(both=True)),
    family("wrapped angle", "From 0 to 360, around zero", SECOND, SWEEP, c.wrapped),
    family("glitch on the input", "One recorded sample is wrong", SECOND, SWEEP, c.input_glitch),
    family("repeated input", "3 % repeat the previous sample", SECOND, SWEEP, c.input_repeated),
    family("frozen input", "Its record is frozen for a while", SECOND, SWEEP, c.input_frozen),
    family("fixed words", "-9999 or 32767 mean no value", SECOND, SWEEP, c.fixed_words),
    family(
        "slow recorder",
        "Of the input, which moves between its samples",
        SECOND,
        k.sweep(high=0.2),
        c.slow_recorder,
    ),
    other("unrelated", "Noise beside a sweep: not identifiable", m.unrelated),
)

BESIDE_ANOTHER = c.another_input(0.1, 1.0)
BESIDE = (
    family(
        "two inputs", "The other moves a tenth as much to as much", SECOND, SWEEP, BESIDE_ANOTHER
    ),
    family(
        "lesser input",
        "The other moves 3 to 20 times as much",
        SECOND,
        SWEEP,
        c.another_input(3.0, 20.0),
    ),
    family("five inputs", "Four others", SECOND, SWEEP, *(BESIDE_ANOTHER,) * 4),
    family("two inputs, PRBS", "The first is held", SECOND, k.sequence("prbs"), BESIDE_ANOTHER),
    family(
        "two inputs, Butterworth", "Order 2 to 6", k.low_pass("butterworth"), SWEEP, BESIDE_ANOTHER
    ),
    family(
        "two inputs, mid-sweep",
        "The record begins in the sweep",
        SECOND,
        SWEEP,
        BESIDE_ANOTHER,
        start=0.25,
    ),
    family(
        "two inputs, drift", "The bias warms up", SECOND, SWEEP, BESIDE_ANOTHER, c.drift("thermal")
    ),
    family("two inputs, mains", "50 or 60 Hz hum", SECOND, SWEEP, BESIDE_ANOTHER, c.mains),
    family("two inputs, modes", "Three or four modes", k.modes(3, 4), SWEEP, BESIDE_ANOTHER),
    family(
        "two inputs, missing",
        "One row in twenty is not there",
        SECOND,
        SWEEP,
        BESIDE_ANOTHER,
        c.missing,
    ),
)
BENT = (
    other("slew", "The servo's speed is limited", m.bent(m.slew, SECOND, SWEEP)),
    other("dead zone", "On the input", m.bent(m.dead, SECOND, SWEEP)),
    other("backlash", "On the output", m.bent(m.loose, SECOND, SWEEP)),
    other("friction", "Dry", m.bent(m.rubbing, SECOND, SWEEP)),
    other("cubic spring", "Hardening or softening", m.bent(m.hardening, SECOND, SWEEP)),
)

LOOPS = (
    other(
        "loop, sensor noise",
        "Plant read from its loop, no reference",
        m.loop(lambda rng: white(), reference=False, biased=False),
    ),
    other(
        "loop, disturbed",
        "Slow disturbance, no reference: biased, so never ok",
        m.loop(slow_disturbance, reference=False, biased=True),
    ),
    other(
        "loop, with reference",
        "Slow disturbance, reference given",
        m.loop(slow_disturbance, reference=True, biased=True),
    ),
    other("servo", "Reference to output of a loop with a delay inside", m.servo),
)

SOFTWARE = (
    other("z^-k", "A whole number of samples late", m.program(m.pure_delay, SWEEP)),
    other(
        "z^-k, white", "The same under white numbers", m.program(m.pure_delay, k.sequence("white"))
    ),
    other("one-pole filter", "y += a (u - y), and late", m.program(m.one_pole, SWEEP)),
    other("IIR filter", "Butterworth of order 1 to 4", m.program(m.low_pass, SWEEP)),
    other(
        "IIR filter, noisy input",
        "The same, 40 to 70 dB on the output",
        m.program(m.low_pass, k.sequence("white"), snr=(40, 70)),
    ),
    other("alpha-beta tracker", "Position estimate", m.program(m.tracker, SWEEP)),
    other("smoother", "A moving average", m.program(m.smoother, SWEEP)),
    other(
        "filter from zero",
        "One of these, its memory zeros while white numbers were under way",
        m.program(m.any_filter, k.sequence("white", quiet=False), settled=False),
    ),
    other(
        "filter from zero, PRBS",
        "The same under a binary sequence",
        m.program(m.any_filter, k.sequence("prbs", quiet=False), settled=False),
    ),
    other("several rates", "A task at every 2 to 8 samples", m.several_rates),
    other("held output", "Updated on a slower clock of its own", m.held_output),
    other("two clocks", "Input and output logged at rates of their own", m.two_clocks),
)

ANY_SYSTEM = (
    k.static, FIRST, SECOND, k.second_order(0.02, 0.1), k.second_order(1.5, 6.0),
    k.low_pass("butterworth"), k.low_pass("bessel"), k.lead, k.lead_lag, k.with_zero,
    k.non_minimum_phase, k.notch, k.anti_resonance, k.modes(2, 2), k.integrator,
    k.lagging_integrator, k.washout, k.ac_coupled, k.differentiator, k.lag_behind_resonance,
)  # fmt: skip
ANY_INPUT = (
    SWEEP, k.sweep("zoh"), k.sweep("foh"), k.slower_clock(k.sweep("zoh")), k.sequence("prbs"),
    k.sequence("fast_prbs"), k.sequence("white"), k.lines(), k.lines("schroeder", periodic=True),
    k.shaped("doublet"), k.shaped("3211"), k.designed("hmpim"), k.designed("exponential"),
    k.designed("reversed"), k.after_a_step(SWEEP),
)  # fmt: skip
ANY_SPOIL = (  # in this order
    c.operating_point(both=False), c.operating_point(both=True), c.stated, c.drift("steady"),
    c.drift("thermal"), c.mains, c.input_noise, c.spikes, c.repeated_frames, c.quantised,
    c.clipped(both=False), c.missing,
)  # fmt: skip


def by_chance(*always: c.Condition) -> Callable[[np.random.Generator], Draw]:
    """Any system under any input, with none, one or two conditions: no draw is like another."""

    def draw(rng: np.random.Generator) -> Draw:
        drive = ANY_INPUT[int(rng.integers(len(ANY_INPUT)))](rng)
        system = ANY_SYSTEM[int(rng.integers(len(ANY_SYSTEM)))](rng, drive)
        take = shoot(rng, system, drive, snr_db=float(rng.uniform(20, 70)))
        for condition in always:
            condition(take)
        some = rng.choice(len(ANY_SPOIL), int(rng.integers(3)), replace=False)
        for place in sorted(some):
            ANY_SPOIL[place](take)
        return finish(take)

    return draw


CHANCE = (
    other("by chance", "Any system, any input, up to two conditions", by_chance()),
    other("by chance, more", "As many again", by_chance()),
    other("by chance, two inputs", "The same, and one more input", by_chance(BESIDE_ANOTHER)),
)

FAMILIES = {
    f.name: f
    for f in (*SYSTEMS, *INPUTS, *BEGINNINGS, *NOISE, *BESIDE, *BENT, *LOOPS, *SOFTWARE, *CHANCE)
}


def named(wanted: str) -> list[str]:
    """Families called so, or that have it in their names; all of them for nothing."""
    if wanted in FAMILIES:
        return [wanted]
    parts = [part.strip() for part in wanted.split(",") if part.strip()]
    chosen = set() if parts else set(FAMILIES)
    for part in parts:
        found = [part] if part in FAMILIES else [n for n in FAMILIES if part.lower() in n.lower()]
        if not found:
            raise KeyError(part)
        chosen.update(found)
    return [name for name in FAMILIES if name in chosen]
