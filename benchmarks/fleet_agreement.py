"""Records of one stimulus told together, held against `identify` of each: five fleets.

Systems of 4 to 12 Hz, damping 0.25 to 0.6, noise of 5 to 20 % of the sweep's amplitude; each unit
differs by 5 % in frequency, damping and delay. A tenth is clipped, drifts, is bent, jumps or is
rounded. Writes how many are told together, how many of these differ in verdict, findings, structure
or assumption, and by how many standard deviations figures are apart.

    python benchmarks/fleet_agreement.py --units 110    # 2 min on an idle machine
"""

from __future__ import annotations

import argparse
from dataclasses import fields

import numpy as np

import hmpim
from hmpim.identify import excited_band
from hmpim.identify.fleets.fleet import fit_fleet
from hmpim.identify.fleets.learnt import learn_fleet
from hmpim.identify.fleets.whole import learn_whole, whole_pairs
from hmpim.identify.kept import keeping
from hmpim.identify.threads import one_thread

FS, SAMPLES, LEARNT = 200.0, 2000, 16
AT = np.arange(SAMPLES) / FS
KINDS = (  # Hz, damping, delay in s, noise, end of the sweep in Hz
    (10.0, 0.4, 0.02, 0.1, 20.0),
    (6.0, 0.5, 0.03, 0.1, 20.0),
    (4.0, 0.25, 0.012, 0.2, 15.0),
    (8.0, 0.5, 0.03, 0.1, 25.0),
    (12.0, 0.6, 0.008, 0.1, 30.0),
)


def records(kind: tuple[float, ...], count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Stimulus and outputs; the last tenth of these is odd."""
    natural, damping, delay, noise, last = kind
    rng = np.random.default_rng([77, seed])
    u = np.sin(2 * np.pi * (0.1 * AT + (last - 0.1) / 20 * AT**2))
    outputs = np.empty((count, SAMPLES))
    for y in outputs:
        omega = 2 * np.pi * natural * (1 + 0.05 * rng.standard_normal())
        own = damping * (1 + 0.05 * rng.standard_normal())
        model = hmpim.Model(
            delay=delay * (1 + 0.05 * rng.standard_normal()),
            scale_factor=1 + 0.02 * rng.standard_normal(),
            denominator=(omega**-2, 2 * own / omega, 1.0),
            bias=0.6,
        )
        y[:] = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
        y += noise * rng.standard_normal(SAMPLES)
    odd = (
        lambda y: np.minimum(y, 1.2),
        lambda y: y + np.linspace(0, 10 * noise, SAMPLES),
        lambda y: y + 0.1 * y**3,
        lambda y: y + 5 * noise * (AT[-1] / 2 < AT),
        lambda y: np.round(y, 1),
    )
    for k in range(count - (count - LEARNT) // 10, count):
        outputs[k] = odd[k % len(odd)](outputs[k])
    return u, outputs


def apart(pair, own) -> dict[str, list[float]]:
    """How far one told together is from one alone, in standard deviations."""
    found: dict[str, list[float]] = {"figures": [], "ends": []}
    for one, other in (
        (pair.parameters, own.parameters),
        (pair.from_response, own.from_response),
    ):
        for name in (field.name for field in fields(one)):
            a, b = getattr(one, name), getattr(other, name)
            if a is None or a.ci95 is None:
                continue
            std = (a.ci95[1] - a.ci95[0]) / 3.92
            found["figures"].append(abs(a.value - b.value) / std)
            found["ends"] += [abs(x - y) / std for x, y in zip(a.ci95, b.ci95, strict=True)]
    one, other = pair.frequency_response, own.frequency_response
    found["response"] = list(np.abs(one.response - other.response) / one.std)
    found["its std, share"] = list(np.abs(other.std / one.std - 1))
    return found


def said(pair) -> tuple:
    return pair.verdict, pair.structure, pair.intersample, tuple(w.code for w in pair.warnings)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        "--units", type=int, default=110, help="of each fleet, beside 16 learnt from"
    )
    options = parser.parse_args()
    every: dict[str, list[float]] = {}
    told = total = differ = 0
    for seed, kind in enumerate(KINDS):
        u, outputs = records(kind, LEARNT + options.units, seed)
        with one_thread(), keeping():
            pairs = [
                hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))["y", "u"]
                for y in outputs
            ]
            fleet = learn_fleet(u, pairs[:LEARNT], fs=FS, band=excited_band(u, FS))
            whole = None if fleet is None else learn_whole(fleet, pairs[:LEARNT])
            rest = outputs[LEARNT:]
            total += rest.shape[0]
            if fleet is None or whole is None:
                print(kind, "is not told together", flush=True)
                continue
            own = whole_pairs(whole, fit_fleet(fleet, rest), rest)
        together = [(p, o) for p, o in zip(pairs[LEARNT:], own, strict=True) if o is not None]
        told += len(together)
        differ += sum(said(p) != said(o) for p, o in together)
        for pair, one in together:
            for name, values in apart(pair, one).items():
                every.setdefault(name, []).extend(values)
        print(kind, f"{len(together)} of {rest.shape[0]} told together", flush=True)
        print(f"{told} of {total}; {differ} differ in verdict, findings or structure", flush=True)
        for name, values in every.items():
            middle, most, last = np.quantile(values, [0.5, 0.99, 1.0])
            print(f"  {name}: {middle:.2g} in the median, 99 % {most:.2g}, at most {last:.2g}")


if __name__ == "__main__":
    main()
