"""The same records by peers, in one run: accuracy, processor time, memory, what each must be given.

`python benchmarks/peers.py` beside what requirements-peers.txt lists; one that is not installed is
left out, and said so. Each peer works in a process of its own, forked after the imports; its
memory is the most that Python and NumPy hold during one record. The record is that of
docs/field.md: second order 10 Hz, damping ratio 0.4, delay 150 ms, bias 0.6, noise 0.1, chirp 0.1
to 20 Hz, 10 s at 200 Hz. `--growth` adds the growth with length, `--table` and `--plot` write both
as docs/performance.md has them.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import multiprocessing
import os
import resource
import time
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from identification_speed import field_record, hand_written
from scipy import signal
from scipy.optimize import least_squares

import hmpim

FS = 200.0
DELAY, NATURAL, DAMPING = 0.15, 10.0, 0.4
START = {"delay": 0.165, "natural": 9.0, "zeta": 0.44, "gain": 0.9, "bias": 0.55}
AT = np.linspace(0.5, 15.0, 146)
"""Frequencies in Hz at which responses are held against the truth."""


@dataclass(frozen=True)
class Found:
    """What a peer says of one record; None for what it does not say."""

    delay: float | None = None
    natural: float | None = None
    zeta: float | None = None
    response: np.ndarray | None = None


def second_order(f, delay, natural, zeta, gain=1.0):
    s, w = 2j * np.pi * f, 2 * np.pi * natural
    return gain * w**2 / (s**2 + 2 * zeta * w * s + w**2) * np.exp(-s * delay)


def of_parameters(delay, natural, zeta, gain=1.0) -> Found:
    return Found(delay, natural, zeta, second_order(AT, delay, natural, zeta, gain))


def of_poles(poles, delay, response, fs=FS) -> Found:
    """Natural frequency and damping of the slowest pair of complex poles of a sampled model."""
    pairs = [p for p in np.log(np.asarray(poles, dtype=complex)) * fs if p.imag > 0]
    if not pairs:
        return Found(delay=delay, response=response)
    s = min(pairs, key=abs)
    return Found(delay, abs(s) / (2 * np.pi), -s.real / abs(s), response)


# --- who is compared ---------------------------------------------------------------------------


def ours(u, y) -> Found:
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)
    pair = hmpim.identify(record)["y", "u"]
    p = pair.parameters
    return of_parameters(
        p.delay.value, p.natural_frequency.value, p.damping_ratio.value, p.scale_factor.value
    )


def by_hand(u, y) -> Found:
    delay, natural, zeta, gain, _ = hand_written(u, y, FS)
    return of_parameters(delay, natural, zeta, gain)


def usual_scipy(u, y) -> Found:
    """Response by Welch's method, a second order laid through it, its delay from a correlation."""
    a, b = u - u.mean(), y - y.mean()
    correlation = signal.correlate(b, a, mode="full", method="fft")
    delay = float(signal.correlation_lags(b.size, a.size)[np.argmax(correlation)] / FS)
    f, across = signal.csd(a, b, FS, nperseg=512)
    _, power = signal.welch(a, FS, nperseg=512)
    response = across / power
    band = (f >= 0.5) & (f <= 15.0)

    def off(p):
        error = second_order(f[band], *p) - response[band]
        return np.concatenate([error.real, error.imag])

    bounds = ([0.0, 0.1, 0.01, 0.01], [1.0, 100.0, 5.0, 10.0])
    delay, natural, zeta, _ = least_squares(off, [delay, 5.0, 0.7, 1.0], bounds=bounds).x
    told = np.interp(AT, f, response.real) + 1j * np.interp(AT, f, response.imag)
    return Found(float(delay), float(natural), float(zeta), told)


def by_aeroid(u, y) -> Found:
    import aeroid

    n, names = u.size, tuple(START)
    spectrum, f = np.fft.rfft(u, 2 * n), np.fft.rfftfreq(2 * n, 1 / FS)

    def simulate(time_, controls, x0, parameters=None, **options):
        p = {**START, **(parameters or {})}
        g = second_order(f, p["delay"], p["natural"], p["zeta"], p["gain"])
        output = np.fft.irfft(g * spectrum, 2 * n)[:n] + p["bias"]
        return aeroid.SimulationResult(
            time=time_,
            states=np.empty((n, 0)),
            outputs=output[:, None],
            state_names=(),
            output_names=("y",),
        )

    model = SimpleNamespace(
        states=(), controls=("u",), outputs=("y",), parameters=dict(START), name="delayed",
        simulate=simulate,
    )  # fmt: skip
    data = aeroid.FlightData(time=np.arange(n) / FS, channels={"u": u, "y": y})
    p = aeroid.identify(model, data, names).parameters
    return of_parameters(p["delay"], p["natural"], p["zeta"], p["gain"])


def by_pysib(u, y) -> Found:
    import pysib

    late = round(DELAY * FS)
    _, model = pysib.oe(u, y - y.mean(), nb=2, nf=2, nz=late + 1)
    _, response = signal.freqz(model["B"], model["F"], worN=AT, fs=FS)
    return of_poles(np.roots(model["F"]), None, response)


def by_era(u, y) -> Found:
    """Of the impulse response by least squares, sampled at 40 Hz, the delay cut off.

    At 200 Hz the chirp leaves four fifths of the band without power, and an impulse response by
    least squares is noise (a condition number of 90 000): sampled down, the chirp fills the band.
    """
    import control

    down, length = 5, 40
    fs = FS / down
    u, y = (signal.resample_poly(x, 1, down) for x in (u, y - y.mean()))
    late = round(DELAY * fs)
    markov = control.markov(y, u, m=length)
    rows = (length - late) // 2 - 5
    model, _ = control.eigensys_realization(markov[late:], r=2, m=rows, n=rows)
    z = np.exp(2j * np.pi * AT / fs)
    response = model(z) * z ** -float(late)
    return of_poles(model.poles(), None, np.asarray(response).ravel(), fs)


def by_pyfrf(u, y) -> Found:
    from pyFRF import FRF

    n = 512
    starts = range(0, u.size - n + 1, n // 2)
    pieces = [np.stack([x[k : k + n] for k in starts]) for x in (u, y - y.mean())]
    frf = FRF(int(FS), *pieces, exc_type="f", resp_type="d", window="hann", weighting="linear")
    response = np.ravel(frf.get_H1())
    f = np.ravel(frf.get_f_axis())
    kept = f <= FS / 2
    f, response = f[kept], response[: f.size][kept]
    return Found(response=np.interp(AT, f, response.real) + 1j * np.interp(AT, f, response.imag))


def by_sdynpy(u, y) -> Found:
    module = _sdynpy()
    f = np.fft.rfftfreq(u.size, 1 / FS)
    kept = f <= 20.0
    spectra = [np.fft.rfft(x)[kept][None] for x in (u, y - y.mean())]
    f_out, response, _ = module.frf_local_model(
        *spectra, f[kept], bandwidth=3.0, max_parallel=1, print_time=False
    )
    response = response[:, 0, 0]
    return Found(
        response=np.interp(AT, f_out, response.real) + 1j * np.interp(AT, f_out, response.imag)
    )


def _sdynpy():
    """Its local models alone: the package itself needs what draws geometry."""
    found = importlib.util.find_spec("sdynpy")
    if found is None or not found.submodule_search_locations:
        raise ImportError("sdynpy")
    place = Path(found.submodule_search_locations[0], "signal_processing", "sdynpy_lrm.py")
    spec = importlib.util.spec_from_file_location("sdynpy_lrm", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_MASS = """<mujoco><option timestep="{dt}" gravity="0 0 0" integrator="RK4"/>
<worldbody><body><joint name="x" type="slide" axis="1 0 0" stiffness="{k}" damping="{d}"/>
<geom type="sphere" size="0.05" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor joint="x" gear="{k}"/></actuator>
<sensor><jointpos joint="x"/></sensor></mujoco>"""


def by_mujoco(u, y) -> Found:
    """A mass on a spring, its force the input; delay, gain and bias by its user's residual."""
    import mujoco
    from mujoco import rollout, sysid

    wide = {
        "delay": (0.0, 0.3), "natural": (5.0, 20.0), "zeta": (0.1, 0.9), "gain": (0.3, 3.0),
        "bias": (-2.0, 2.0),
    }  # fmt: skip
    params = sysid.ParameterDict(
        {name: sysid.Parameter(name, START[name], *wide[name]) for name in START}
    )
    t = np.arange(u.size) / FS
    steps = 4
    fine = np.interp(np.arange(steps * u.size) / (steps * FS), t, u)

    def residual(x, *_):
        delay, natural, zeta, gain, bias = np.ravel(x)
        w = 2 * np.pi * natural
        text = _MASS.format(dt=1 / (steps * FS), k=w**2, d=2 * zeta * w)
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        state = np.zeros(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        _, sensed = rollout.rollout(model, data, state, fine[None, :, None])
        position = sensed[0, :, 0]
        at = np.arange(position.size) / (steps * FS)  # sensors are read before each step
        return [gain * np.interp(t - delay, at, position, left=0.0) + bias - y], None, None

    found, _ = sysid.optimize(params, residual, optimizer="scipy", verbose=False)
    delay, natural, zeta, gain, _ = np.ravel(found.as_vector())
    return of_parameters(delay, natural, zeta, gain)


PEERS: dict[str, tuple[Callable, str]] = {
    "hmpim.identify": (ours, "nothing"),
    "fit by hand, transforms": (by_hand, "the model, a start within 10 %"),
    "scipy: correlate, csd": (usual_scipy, "segment, band, order"),
    "aeroid": (by_aeroid, "a delay model of one's own, a start within 10 %"),
    "pysib, output error": (by_pysib, "the delay and the orders"),
    "python-control, ERA": (
        by_era,
        "the delay, order, length, a rate that the stimulus fills",
    ),
    "mujoco.sysid": (by_mujoco, "the model, the delay's residual, start and bounds"),
    "pyFRF, H1": (by_pyfrf, "segment and window; gives the response alone"),
    "SDynPy, local rational": (by_sdynpy, "bandwidth; gives the response alone"),
}


# --- how ---------------------------------------------------------------------------------------


def _child(name: str, records: list, line) -> None:
    peer, _ = PEERS[name]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            peer(*records[0])  # its imports are not its work
            found, spent = [], []
            for u, y in records:
                begin = time.process_time()
                found.append(peer(u, y))
                spent.append(time.process_time() - begin)
            tracemalloc.start()  # of Python and NumPy; it slows, so after the times
            peer(*records[0])
            _, most = tracemalloc.get_traced_memory()
        line.send((found, spent, most / 2**20))
    except Exception as error:  # code of others: what it raises is its row
        line.send(f"{type(error).__name__}: {error}")


def asked(name: str, records: list, limit: float):
    """What a peer says of some records, from a process of its own, within so many seconds."""
    context = multiprocessing.get_context("fork")
    ours_, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_child, args=(name, records, theirs))
    process.start()
    theirs.close()
    try:
        told = ours_.recv() if ours_.poll(limit) else f"no answer within {limit:g} s"
    except EOFError:
        told = "its process ended"
    process.kill()
    process.join()
    return told


def row_of(name: str, told) -> dict[str, object]:
    found, spent, memory = told
    truth = second_order(AT, DELAY, NATURAL, DAMPING)

    def rms(which: str, true: float) -> float | None:
        values = [getattr(f, which) for f in found]
        if any(v is None for v in values):
            return None
        return float(np.sqrt(np.mean((np.array(values) - true) ** 2)))

    errors = [np.median(np.abs(f.response - truth) / np.abs(truth)) for f in found]
    return {
        "peer": name,
        "delay_ms": None if (d := rms("delay", DELAY)) is None else 1e3 * d,
        "natural_hz": rms("natural", NATURAL),
        "damping": rms("zeta", DAMPING),
        "response_percent": 100 * float(np.median(errors)),
        "processor_ms": 1e3 * float(np.median(spent)),
        "memory_mb": memory,
        "given": PEERS[name][1],
    }


def printed(rows: list[dict]) -> str:
    """The table as docs/performance.md has it."""
    head = "| | delay, ms | Hz | damping ratio | response, % | time, ms | memory, MB | given |"
    lines = [head, "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for row in rows:
        figures = [
            "–" if row[k] is None else f"{row[k]:.3g}"
            for k in (
                "delay_ms",
                "natural_hz",
                "damping",
                "response_percent",
                "processor_ms",
                "memory_mb",
            )
        ]
        lines.append(f"| {row['peer']} | {' | '.join(figures)} | {row['given']} |")
    return "\n".join(lines)


def growth(most: float, whole: float) -> list[dict]:
    """Processor time and memory of identify by length, and by statistics in blocks beyond."""
    rows = []
    context = multiprocessing.get_context("fork")
    for samples in (10**k for k in range(3, 9)):
        if samples > most:
            break
        for way in ("identify", "statistics"):
            if way == "identify" and samples > whole:
                continue
            mine, other = context.Pipe(duplex=False)
            process = context.Process(target=_grown, args=(samples, way, other))
            process.start()
            other.close()
            try:
                row = mine.recv()
            except EOFError:
                row = {"samples": samples, "way": way, "processor_s": None, "memory_mb": None}
            process.join()
            rows.append(row)
            print(json.dumps(row), flush=True)
    return rows


def grown_table(rows: list[dict]) -> str:
    """Growth as docs/performance.md has it."""
    lines = ["| samples | `identify`: processor, memory | statistics: processor, memory |",
             "| --- | --- | --- |"]  # fmt: skip
    for samples in dict.fromkeys(r["samples"] for r in rows):
        cells = {r["way"]: r for r in rows if r["samples"] == samples}
        told = [
            "–" if (r := cells.get(way)) is None or r["processor_s"] is None
            else f"{r['processor_s']:.2g} s, {r['memory_mb']:.0f} MB"
            for way in ("identify", "statistics")
        ]  # fmt: skip
        lines.append(f"| {samples} | {' | '.join(told)} |")
    return "\n".join(lines)


def draw(rows: list[dict], path: Path) -> None:
    """Processor time and memory over the length of a record."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    for way in ("identify", "statistics"):
        some = [r for r in rows if r["way"] == way and r["processor_s"] is not None]
        for axis, key in zip(axes, ("processor_s", "memory_mb"), strict=True):
            axis.plot([r["samples"] for r in some], [r[key] for r in some], "o-", label=way)
    for axis, name in zip(axes, ("processor time, s", "memory beyond the start, MB"), strict=True):
        axis.set(xscale="log", yscale="log", xlabel="samples", ylabel=name)
        axis.grid(alpha=0.3)
    axes[0].legend(frameon=False)
    figure.savefig(path)


def _grown(samples: int, way: str, line) -> None:
    """A chirp of so many samples at 200 Hz, read in blocks of 100 000 by the statistics."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    rng = np.random.default_rng(0)
    b, a, _ = signal.cont2discrete(
        ([(2 * np.pi * NATURAL) ** 2], [1, 0.8 * 2 * np.pi * NATURAL, (2 * np.pi * NATURAL) ** 2]),
        1 / FS, method="zoh",
    )  # fmt: skip
    b, late = np.ravel(b), 30
    state, past = np.zeros(2), np.zeros(late)
    block, spent, statistics, kept = min(samples, 100_000), 0.0, None, []
    for begin in range(0, samples, block):
        t = np.arange(begin, min(begin + block, samples)) / FS
        u = np.sin(2 * np.pi * (0.1 * t + 0.5 * 19.9 * FS / samples * t**2))
        x, state = signal.lfilter(b, a, u, zi=state)
        y = np.concatenate([past, x])[: x.size] + 0.6 + 0.1 * rng.standard_normal(x.size)
        past = np.concatenate([past, x])[-late:]
        at = time.process_time()
        if way == "identify":
            kept.append((u, y))
        elif statistics is None:
            record = hmpim.Record.from_arrays(
                {"u": u}, {"y": y}, fs=FS, intersample="zoh", band=(0.1, 20.0)
            )
            statistics = hmpim.compress(record, lags=min(400, samples // 5))
        else:
            statistics.update(u, y)
        spent += time.process_time() - at
    if way == "identify":
        u, y = (np.concatenate(x) for x in zip(*kept, strict=True))
        kept.clear()
        record = hmpim.Record.from_arrays(
            {"u": u}, {"y": y}, fs=FS, intersample="zoh", band=(0.1, 20.0)
        )
        statistics = record
    at = time.process_time()
    pair = hmpim.identify(statistics)["y", "u"]
    spent += time.process_time() - at
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    line.send(
        {
            "samples": samples,
            "way": way,
            "processor_s": spent,
            "memory_mb": (peak - before) / 1024,
            "natural_hz": None if pair.natural_frequency is None else pair.natural_frequency.value,
        }
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for each peer")
    parser.add_argument("--only", default="", help="names of peers, separated by semicolons")
    parser.add_argument("--growth", type=float, default=0.0, help="up to so many samples")
    parser.add_argument("--whole", type=float, default=1e6, help="identify itself up to so many")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--plot", type=Path, help="growth with length")
    options = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    records = [field_record(FS, seed) for seed in range(options.seeds)]
    rows = []
    for name in PEERS:
        if options.only and name not in options.only.split(";"):
            continue
        told = asked(name, records, options.limit)
        if isinstance(told, str):
            print(f"{name} is left out: {told}", flush=True)
            continue
        rows.append(row_of(name, told))
        print(json.dumps(rows[-1]), flush=True)
    print(printed(rows))
    grown = growth(options.growth, options.whole) if options.growth else []
    print(grown_table(grown))
    if options.table:
        options.table.write_text(f"{printed(rows)}\n\n{grown_table(grown)}\n")
    if options.plot:
        draw(grown, options.plot)
    if options.json:
        options.json.write_text(json.dumps({"peers": rows, "growth": grown}, indent=1) + "\n")


if __name__ == "__main__":
    main()
