"""Each waveform's formula in C99, operation by operation as it is evaluated here.

A waveform becomes one function of the time that returns a `hmpim_motion`. One that holds
another, as a lead does its sweep, calls the other's function, which is written first.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hmpim.errors import ArgumentError
from hmpim.formats.models.render import c_number
from hmpim.stimulus import (
    Chirp,
    ExponentialSweep,
    Multisine,
    Prbs,
    Quintic,
    Ramp,
    Repeated,
    RestToRest,
    Reversed,
    SampledMotion,
    Sine,
    Step,
    Steps,
    SumOfSines,
    Sweep,
    Waveform,
)
from hmpim.stimulus.multisine import even_step
from hmpim.stimulus.repeated import CORNER

__all__ = ["functions_of"]

_BITS = 8  # of a binary sequence in each byte


class _Written:
    """The functions of one stimulus, in the order in which C wants them."""

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix
        self.parts: list[str] = []

    def add(self, waveform: Any) -> str:
        """Write a waveform's function, those it calls before it, and return its name."""
        writer = _WRITERS.get(type(waveform))
        if writer is None:
            raise ArgumentError(_refusal(waveform))
        what, tables, body = writer(waveform, self)
        name = f"{self._prefix}_{len(self.parts) + 1}"
        lines = [f"/* {what} */", *(table.replace("@", name) for table in tables)]
        lines += [f"static hmpim_motion {name}(double t)", "{"]
        lines += [f"    {line}".rstrip() for line in body.replace("@", name).strip().split("\n")]
        self.parts.append("\n".join([*lines, "}"]))
        return name


def functions_of(waveform: Waveform, *, prefix: str) -> tuple[list[str], str]:
    """Write the C functions of a waveform.

    Parameters
    ----------
    waveform : Waveform
        Any that has a formula.
    prefix : str
        With which each function's name begins.

    Returns
    -------
    functions : list of str
        In the order in which they must stand.
    name : str
        Of the one that is the waveform.

    Raises
    ------
    ArgumentError
        If it is known by its samples only, or is of no kind that this package makes.

    Examples
    --------
    >>> parts, name = functions_of(Sine(frequency=2.0, duration=1.0), prefix="roll")
    >>> len(parts), name
    (1, 'roll_1')
    """
    written = _Written(prefix)
    name = written.add(waveform)
    return written.parts, name


def _refusal(waveform: Any) -> str:
    if isinstance(waveform, SampledMotion):
        return (
            "a motion that is known by its samples alone has no formula that a target could "
            "compute; save it as .h, a table of its samples"
        )
    return (
        f"a {type(waveform).__name__} has no formula in C here; save it as .h, a table of its "
        "samples"
    )


_Made = tuple[str, list[str], str]


def _table(name: str, values: ArrayLike) -> str:
    numbers = ",\n    ".join(c_number(float(v)) for v in np.ravel(values))
    return f"static const double @_{name}[{np.size(values)}] = {{\n    {numbers}\n}};"


def _around(duration: float, formula: str) -> str:
    """A formula that holds on [0, duration]; at rest at its ends' positions outside."""
    return f"""
hmpim_motion m;
const double asked = t, length = {c_number(duration)};

t = t < 0.0 ? 0.0 : t > length ? length : t;
{formula.strip()}
return asked < 0.0 || asked > length ? hmpim_still(m.position) : m;
"""


def _sweep(sweep: Sweep, written: _Written) -> _Made:
    low, high = sweep.band
    what = (
        f"Equations (5) to (7): {low:.9g} to {high:.9g} Hz in {sweep.duration:.9g} s, "
        f"G = {sweep.gain:.9g}, n = {sweep.extinction:.9g}."
    )
    return what, [], _around(sweep.duration, _sweep_formula(sweep))


def _sweep_formula(sweep: Sweep) -> str:
    n = sweep.extinction
    at_zero = sweep.start_omega + (0.5 * sweep.sweep_rate if n == 0.0 else 0.0)
    power = "pow(t, n)" if n != 0.0 else "1.0"
    return f"""
{{
    const double a = {c_number(sweep.sweep_rate)}, b = {c_number(sweep.start_omega)};
    const double n = {c_number(n)}, gain = {c_number(sweep.gain)};
    const double omega = b + a * t, phase = t * (b + 0.5 * a * t);
    const double sine = sin(phase), cosine = cos(phase);

    if (t > 1e-30) {{
        const double power = {power}, sigma = b + 0.5 * a * power;
        const double slope = 0.5 * a * n * power / t, curve = slope * (n - 1.0) / t;

        m.position = sine / sigma;
        m.velocity = (omega * cosine - slope * m.position) / sigma;
        m.acceleration = (a * cosine - omega * omega * sine - 2.0 * omega * slope * cosine / sigma
            - curve * m.position + 2.0 * slope * slope * m.position / sigma) / sigma;
    }} else {{ /* at the start the finite part: for 0 < n < 1 (7) is unbounded there */
        m.position = 0.0;
        m.velocity = b / {c_number(at_zero)};
        m.acceleration = {"0.0" if n == 1.0 else f"a / {c_number(at_zero)}"};
    }}
    m = hmpim_scaled(m, gain);
}}
"""


def _chirp(chirp: Chirp, written: _Written) -> _Made:
    unit = Sweep(band=chirp.band, duration=chirp.duration, gain=1.0, extinction=0.0)
    inner = written.add(unit)
    scale = chirp.amplitude * (unit.start_omega + 0.5 * unit.sweep_rate)
    body = f"return hmpim_scaled({inner}(t), {c_number(scale)});"
    return f"Equations (1) to (3), amplitude {chirp.amplitude:.9g}.", [], body


def _exponential(sweep: ExponentialSweep, written: _Written) -> _Made:
    low, high = sweep.band
    k, fall = sweep.growth, -sweep.extinction * sweep.growth
    start = 2.0 * math.pi * low
    formula = f"""
{{
    const double k = {c_number(k)}, fall = {c_number(fall)}, start = {c_number(start)};
    const double omega = start * exp(k * t), phase = start / k * expm1(k * t);
    const double size = {c_number(sweep.gain)} * exp(fall * t);
    const double sine = size * sin(phase), cosine = size * cos(phase);

    m.position = sine;
    m.velocity = fall * sine + omega * cosine;
    m.acceleration = (fall * fall - omega * omega) * sine + (2.0 * fall + k) * omega * cosine;
}}
"""
    what = (
        f"An exponential sweep: {low:.9g} to {high:.9g} Hz in {sweep.duration:.9g} s, "
        f"G = {sweep.gain:.9g}, n = {sweep.extinction:.9g}."
    )
    return what, [], _around(sweep.duration, formula)


def _repeated(waveform: Repeated, written: _Written) -> _Made:
    low, high = (2.0 * math.pi * f for f in waveform.band)
    powers = [4.0 * (k + 1) for k, corner in enumerate(waveform.corners) if math.isfinite(corner)]
    bends = [2.0 * math.pi * corner for corner in waveform.corners if math.isfinite(corner)]
    terms = "".join(
        f"""
    term = pow(omega / {c_number(bend)}, {c_number(power)});
    s0 += term;
    s1 += term * {c_number(power)} / omega;
    s2 += term * {c_number(power)} * {c_number(power - 1.0)} / (omega * omega);
"""
        for bend, power in zip(bends, powers, strict=True)
    )
    formula = f"""
{{
    const double sweep = {c_number(waveform.sweep)}, span = {c_number(waveform.span)};
    const double corner = {c_number(CORNER)}, turn = rint(t / sweep), x = t / sweep - turn;
    const int up = (long)turn % 2 == 0;
    const double base = up ? {c_number(low)} : {c_number(high)}, way = up ? 1.0 : -1.0;
    const double size = fabs(x), z = x / corner, side = x < 0.0 ? -1.0 : 1.0;
    const int near = size < corner;
    const double value = near ? corner * (0.375 + 0.75 * z * z - 0.125 * z * z * z * z) : size;
    const double slope = near ? 1.5 * z - 0.5 * z * z * z : side;
    const double curve = near ? 1.5 * (1.0 - z * z) / corner : 0.0;
    const double e = near ? z : side;
    const double inner = corner * corner * (0.375 * e + 0.25 * e * e * e
        - 0.025 * e * e * e * e * e);
    const double outer = near ? 0.0 : 0.5 * side * (x * x - corner * corner);
    const double omega = base + way * span * (value - 0.375 * corner);
    const double rate = way * span * slope / sweep, bend = way * span * curve / (sweep * sweep);
    const double phase = sweep * ({c_number(0.5 * (low + high))} * turn + base * x
        + way * span * (inner + outer - 0.375 * corner * x));
    const double sine = sin(phase), cosine = cos(phase);
    double s0 = 1.0, s1 = 0.0, s2 = 0.0{", term" if terms else ""}, a0, a1, a2, by1, by2;
{terms}
    a0 = {c_number(waveform.amplitude)} * pow(s0, -0.25);
    by1 = -0.25 * a0 * s1 / s0;
    by2 = -0.25 * a0 * (s2 / s0 - 1.25 * s1 / s0 * s1 / s0);
    a1 = by1 * rate;
    a2 = by2 * rate * rate + by1 * bend;
    m.position = a0 * sine;
    m.velocity = a1 * sine + a0 * omega * cosine;
    m.acceleration = a2 * sine + 2.0 * a1 * omega * cosine
        + a0 * (rate * cosine - omega * omega * sine);
}}
"""
    what = (
        f"Sweeps up and down, {waveform.band[0]:.9g} to {waveform.band[1]:.9g} Hz in "
        f"{waveform.sweep:.9g} s each."
    )
    return what, [], _around(waveform.duration, formula)


def _reversed(waveform: Reversed, written: _Written) -> _Made:
    inner = written.add(waveform.waveform)
    body = f"""
hmpim_motion m = {inner}({c_number(waveform.duration)} - t);

m.velocity = 0.0 - m.velocity;
return m;
"""
    return "The same, last instant first.", [], body


def _quintic(curve: Quintic, written: _Written) -> _Made:
    c0, c1, c2, c3, c4, c5 = (c_number(c) for c in curve.coefficients)
    body = f"""
hmpim_motion m;
const double length = {c_number(curve.duration)}, s = (t - {c_number(curve.start)}) / length;
const double c0 = {c0}, c1 = {c1}, c2 = {c2};
const double c3 = {c3}, c4 = {c4}, c5 = {c5};

m.position = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))));
m.velocity = (c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / length;
m.acceleration = (2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / (length * length);
return m;
"""
    return "A polynomial of fifth degree.", [], body


def _led(waveform: RestToRest, written: _Written) -> _Made:
    begin, joined, left, end = waveform.joints
    lead_in, lead_out = waveform.lead_in, waveform.lead_out
    core = written.add(waveform.core)
    into = written.add(lead_in) if lead_in.duration > 0.0 else None
    out = written.add(lead_out) if lead_out.duration > 0.0 else None
    rows = ["const hmpim_motion rest = {0.0, 0.0, 0.0};", ""]
    if into is not None:
        rows += [f"if (t >= {c_number(begin)} && t < {c_number(joined)}) {{"]
        rows += [f"    return {into}(t);", "}"]
    rows += [f"if (t >= {c_number(joined)} && t <= {c_number(left)}) {{"]
    rows += [f"    return {core}(t - {c_number(waveform.sweep_start)});", "}"]
    if out is not None:
        rows += [f"if (t > {c_number(left)} && t < {c_number(end)}) {{"]
        rows += [f"    return {out}(t);", "}"]
    rows += ["return rest;"]
    return "From rest into it, and back to rest.", [], "\n".join(rows)


def _multisine(waveform: Multisine, written: _Written) -> _Made:
    omegas = [2.0 * math.pi * f for f in waveform.frequencies]
    pairs = list(zip(waveform.amplitudes, waveform.phases, strict=True))
    tables = [
        _table("omega", omegas),
        _table("real", [A * math.cos(phi) for A, phi in pairs]),
        _table("imaginary", [A * math.sin(phi) for A, phi in pairs]),
    ]
    step = even_step(waveform.frequencies)
    turned = (
        "const double before = c;\n\n"
        "        c = c * turn_cos - s * turn_sin;\n"
        "        s = s * turn_cos + before * turn_sin;"
        if step > 0.0
        else "c = cos(@_omega[k] * t);\n        s = sin(@_omega[k] * t);"
    )
    turn = f"""
const double turn_cos = cos({c_number(2.0 * math.pi * step)} * t);
const double turn_sin = sin({c_number(2.0 * math.pi * step)} * t);
"""
    formula = f"""
{turn.strip() if step > 0.0 else ""}
double c = cos(@_omega[0] * t), s = sin(@_omega[0] * t);
int k;

m = hmpim_still(0.0);
for (k = 0; k < {len(omegas)}; k++) {{
    double cosine, sine;

    if (k > 0) {{
        {turned}
    }}
    cosine = @_real[k] * c - @_imaginary[k] * s;
    sine = @_omega[k] * (@_real[k] * s + @_imaginary[k] * c);
    m.position += cosine;
    m.velocity -= sine;
    m.acceleration -= @_omega[k] * @_omega[k] * cosine;
}}
"""
    body = _around(waveform.duration, f"{{\n{_indented(formula)}\n}}")
    return f"A sum of {len(omegas)} sinusoids.", tables, body


def _sines(waveform: SumOfSines, written: _Written) -> _Made:
    phases = waveform.phases or (0.0,) * len(waveform.frequencies)
    tables = [
        _table("amplitude", waveform.amplitudes),
        _table("omega", [2.0 * math.pi * f for f in waveform.frequencies]),
        _table("phase", phases),
    ]
    formula = f"""
{{
    int k;

    m = hmpim_still(0.0);
    for (k = 0; k < {len(phases)}; k++) {{
        const double omega = @_omega[k], angle = omega * t + @_phase[k];

        m.position += @_amplitude[k] * sin(angle);
        m.velocity += @_amplitude[k] * omega * cos(angle);
        m.acceleration -= @_amplitude[k] * omega * omega * sin(angle);
    }}
}}
"""
    what = f"A sum of {len(phases)} sinusoids."
    return what, tables, _around(waveform.duration, formula)


def _sine(sine: Sine, written: _Written) -> _Made:
    one = SumOfSines(
        amplitudes=(sine.amplitude,), frequencies=(sine.frequency,), duration=sine.duration
    )
    return _sines(one, written)


def _step(step: Step, written: _Written) -> _Made:
    body = f"return hmpim_still(t >= {c_number(step.start)} ? {c_number(step.amplitude)} : 0.0);"
    return "A step.", [], body


def _ramp(ramp: Ramp, written: _Written) -> _Made:
    formula = f"""
{{
    const double start = {c_number(ramp.start)}, rate = {c_number(ramp.rate)};

    m.position = t >= start ? rate * (t - start) : 0.0;
    m.velocity = t >= start ? rate : 0.0;
    m.acceleration = 0.0;
}}
"""
    return "A ramp.", [], _around(ramp.duration, formula)


def _steps(steps: Steps, written: _Written) -> _Made:
    levels = (0.0, *steps.levels)
    count = len(levels) - 2
    return (
        f"{len(steps.levels)} transitions of minimum jerk.",
        [_table("levels", levels)],
        f"""
const int k = hmpim_transition(t, {c_number(steps.hold)}, {count});

return hmpim_minimum_jerk(t, k, {c_number(steps.hold)}, {c_number(steps.rise)},
    {c_number(steps.duration)}, @_levels[k], @_levels[k + 1]);
""",
    )


def _prbs(prbs: Prbs, written: _Written) -> _Made:
    played = prbs.levels[1:-1] > 0.0
    period = min(prbs.bits, 2**prbs.order - 1)
    packed = np.packbits(played[:period], bitorder="little")
    numbers = ",\n    ".join(
        ", ".join(str(v) for v in packed[i : i + 16]) for i in range(0, packed.size, 16)
    )
    table = f"static const unsigned char @_bits[{packed.size}] = {{\n    {numbers}\n}};"
    level = f"""static double @_level(int k)
{{
    if (k < 1 || k > {prbs.bits}) {{
        return 0.0;
    }}
    k = (k - 1) % {period};
    return (@_bits[k / {_BITS}] >> k % {_BITS} & 1) != 0 ? {c_number(prbs.amplitude)}
        : {c_number(-prbs.amplitude)};
}}
"""
    return (
        f"A binary sequence of {prbs.bits} bits through transitions of minimum jerk.",
        [table, level],
        f"""
const int k = hmpim_transition(t, {c_number(prbs.bit)}, {prbs.bits});

return hmpim_minimum_jerk(t, k, {c_number(prbs.bit)}, {c_number(prbs.rise)},
    {c_number(prbs.duration)}, @_level(k), @_level(k + 1));
""",
    )


def _indented(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.strip().split("\n"))


_WRITERS: dict[type, Callable[[Any, _Written], _Made]] = {
    Chirp: _chirp,
    ExponentialSweep: _exponential,
    Multisine: _multisine,
    Prbs: _prbs,
    Quintic: _quintic,
    Ramp: _ramp,
    Repeated: _repeated,
    RestToRest: _led,
    Reversed: _reversed,
    Sine: _sine,
    Step: _step,
    Steps: _steps,
    SumOfSines: _sines,
    Sweep: _sweep,
}
