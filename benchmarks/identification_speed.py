"""Speed of one identification against a hand-written scipy fit with a good start.

All see the same record in the same process, turn by turn, so that a busy machine slows all. Times
are processor times of the thread, which other work lengthens least. The hand-written fits are
given the structure, and start within 10 % of the truth; the package is given nothing. One is
written for speed: the response by transforms of the whole record. The other is what the manual of
scipy leads to: `curve_fit` over `signal.lsim`. Run with `make bench`.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
import scipy
from scipy import signal
from scipy.optimize import curve_fit, least_squares

import hmpim


def field_record(fs: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Second order 10 Hz, ζ 0.4, delay 150 ms, bias 0.6, noise 0.1, chirp 0.1-20 Hz, 10 s."""
    stimulus = hmpim.Stimulus(
        waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0, amplitude=1.0), fs=fs
    )
    sensor = hmpim.Sensor(
        delay=0.15, natural_frequency=10.0, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    record = hmpim.run(sensor, stimulus, rng=seed)
    return record.inputs[0].values, record.outputs[0].values


def hand_written(u: np.ndarray, y: np.ndarray, fs: float) -> np.ndarray:
    """Fit delay, natural frequency, damping, gain and bias, each start 10 % off."""
    n = u.size
    length = 2 * n
    spectrum = np.fft.rfft(u, length)
    s = 2j * np.pi * np.fft.rfftfreq(length, 1 / fs)

    def residual(p: np.ndarray) -> np.ndarray:
        delay, natural, zeta, gain, bias = p
        w = 2 * np.pi * natural
        response = gain * w**2 / (s**2 + 2 * zeta * w * s + w**2) * np.exp(-s * delay)
        return np.fft.irfft(response * spectrum, length)[:n] + bias - y

    start = np.array([0.165, 9.0, 0.44, 0.9, 0.55])
    return least_squares(residual, start, x_scale=[0.01, 1.0, 0.1, 1.0, 1.0], method="trf").x


def by_the_manual(u: np.ndarray, y: np.ndarray, fs: float) -> np.ndarray:
    """The same with `signal.lsim`, the delay by linear interpolation."""
    t = np.arange(u.size) / fs

    def model(t, delay, natural, zeta, gain, bias):
        w = 2 * np.pi * natural
        late = np.interp(t - delay, t, u, left=u[0])
        _, response, _ = signal.lsim(([gain * w**2], [1, 2 * zeta * w, w**2]), late, t)
        return response + bias

    start = [0.165, 9.0, 0.44, 0.9, 0.55]
    return curve_fit(model, t, y, start)[0]


def timed(function, *arguments) -> float:
    begin = time.thread_time()
    function(*arguments)
    return time.thread_time() - begin


def compare(fs: float, turns: int) -> dict[str, float]:
    u, y = field_record(fs)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=fs)
    hand_written(u, y, fs)
    hmpim.identify(record)
    ours, theirs, manual = [], [], []
    for turn in range(turns):
        theirs.append(timed(hand_written, u, y, fs))
        ours.append(timed(hmpim.identify, record))
        if turn < 3:  # it takes long
            manual.append(timed(by_the_manual, u, y, fs))
    return {
        "fs": fs,
        "samples": u.size,
        "hand_written_ms": 1e3 * float(np.median(theirs)),
        "identify_ms": 1e3 * float(np.median(ours)),
        "by_the_manual_ms": 1e3 * float(np.median(manual)),
        "ratio_by_the_manual": float(np.median(ours) / np.median(manual)),
        "ratio": float(np.median(np.array(ours) / np.array(theirs))),
    }


def against_correlation(samples: int, turns: int = 3) -> dict[str, float]:
    """Processor time of one identification over that of correlating the record once by FFT."""
    stimulus = hmpim.Stimulus(
        waveform=hmpim.Chirp(band=(0.1, 20.0), duration=samples / 1000.0, amplitude=1.0), fs=1000.0
    )
    sensor = hmpim.Sensor(
        delay=0.15, natural_frequency=10.0, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    record = hmpim.run(sensor, stimulus, rng=0)
    u, y = record.inputs[0].values, record.outputs[0].values
    length = scipy.fft.next_fast_len(2 * samples, real=True)

    def correlate() -> np.ndarray:
        spectra = np.conj(scipy.fft.rfft(u, length)) * scipy.fft.rfft(y, length)
        return scipy.fft.irfft(spectra, length)

    correlate()
    pairs = [(timed(hmpim.identify, record), timed(correlate)) for _ in range(turns)]
    ours, theirs = np.median(np.array(pairs), axis=0)
    ratio = float(np.median([one / other for one, other in pairs]))
    return {"samples": samples, "identify_s": ours, "correlation_s": theirs, "ratio": ratio}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=30)
    parser.add_argument("--long", type=float, default=1e6, help="samples of the long record")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = [compare(fs, options.turns) for fs in (200.0, 1000.0)]
    print(
        f"{'rate':>8} {'samples':>8} {'for speed':>12} {'lsim':>11} {'identify':>12} {'ratios':>13}"
    )
    for row in rows:
        print(
            f"{row['fs']:6.0f}Hz {row['samples']:8d} {row['hand_written_ms']:9.1f} ms "
            f"{row['by_the_manual_ms']:8.0f} ms {row['identify_ms']:9.1f} ms "
            f"{row['ratio']:6.2f} {row['ratio_by_the_manual']:6.3f}"
        )
    long = against_correlation(int(options.long))
    print(
        f"{long['samples']} samples: identify {long['identify_s']:.2f} s, correlation by FFT "
        f"{long['correlation_s']:.3f} s, ratio {long['ratio']:.1f}"
    )
    if options.json:
        options.json.write_text(json.dumps([*rows, long], indent=1) + "\n")


if __name__ == "__main__":
    main()
