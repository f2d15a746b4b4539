"""Software under test, sample over sample: its delay is a whole number of samples, and exact."""

import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

import hmpim
from hmpim.rigs import FunctionRig
from hmpim.rigs.software import FmuRig, ProcessRig
from tests_support import c_compiler, in_studies

EXAMPLES = Path(__file__).parents[3] / "examples" / "software"


class Late:
    """y[k] = pole y[k-1] + (1 - pole) u[k - late]."""

    def __init__(self, late, pole=0.0):
        self.late, self.pole = late, pole
        self.reset()

    def reset(self):
        self.y, self.line = 0.0, [0.0] * self.late

    def __call__(self, u):
        self.line.append(u)
        self.y = self.pole * self.y + (1 - self.pole) * self.line.pop(0)
        return self.y


class AlphaBeta:
    def __init__(self):
        self.reset()

    def reset(self):
        self.x = self.v = 0.0

    def __call__(self, u):
        ahead = self.x + self.v
        self.x, self.v = ahead + 0.5 * (u - ahead), self.v + 0.1 * (u - ahead)
        return self.x


class Kalman:
    """Position and rate at constant rate; the gain is that of its steady state."""

    def __init__(self):
        step, noise = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.05
        drive = noise * np.array([[0.25, 0.5], [0.5, 1.0]])
        spread = 10.0 * np.eye(2)
        for _ in range(500):
            spread = step @ spread @ step.T + drive
            gain = spread[:, 0] / (spread[0, 0] + 1.0)
            spread = spread - np.outer(gain, spread[0])
        self.gain, self.step = gain, step
        self.reset()

    def reset(self):
        self.x = np.zeros(2)

    def __call__(self, u):
        ahead = self.step @ self.x
        self.x = ahead + self.gain * (u - ahead[0])
        return float(self.x[0])


class Median:
    def __init__(self):
        self.reset()

    def reset(self):
        self.last = [0.0] * 5

    def __call__(self, u):
        self.last = [*self.last[1:], u]
        return float(np.median(self.last))


LINEAR = {
    "z-1": (Late(1), 1),
    "z-7": (Late(7), 7),
    "iir": (Late(0, 0.8), 0),
    "iir behind z-4": (Late(4, 0.8), 4),
    "alpha-beta": (AlphaBeta(), 0),
    "kalman": (Kalman(), 0),
}
FALSE = {"negative_delay", "lack_of_fit", "hold", "nonlinear", "structure", "halves_disagree"}
"""What must not be remarked of a linear algorithm that has no hold."""


def sweep_of(fs, seconds):
    limits = hmpim.Limits(position=10, unit="deg")
    return hmpim.design(band=(0.1, fs / 10), duration=seconds, fs=fs, limits=limits)


def sampled(record):
    """The pair, sample over sample."""
    return hmpim.identify(record, intersample="sampled").pairs[0]


def assert_exact(record, late, fs):
    pair = sampled(record)
    assert pair.parameters.delay.value * fs == pytest.approx(late, abs=1e-6)
    assert pair.parameters.hold_period is None
    assert not FALSE & {warning.code for warning in pair.warnings}
    assert pair.verdict == "ok"


@pytest.mark.parametrize("seconds", [5, *in_studies(10)])
@pytest.mark.parametrize("fs", [200.0, *in_studies(50.0, 1000.0)])
@pytest.mark.parametrize("name", LINEAR)
def test_the_delay_of_a_linear_algorithm_is_exact(name, fs, seconds):
    algorithm, late = LINEAR[name]
    rig = FunctionRig(function=algorithm, mode="sample", reset=algorithm.reset)
    assert_exact(hmpim.run(rig, sweep_of(fs, seconds)), late, fs)


@pytest.mark.parametrize("fs", [200.0, *in_studies(50.0, 1000.0)])
def test_the_delay_of_a_c_program_is_exact(fs, tmp_path):
    program = tmp_path / "alpha_beta"
    subprocess.run([c_compiler(), "-std=c99", "-o", program, EXAMPLES / "alpha_beta.c"], check=True)
    rig = ProcessRig(command=shlex.quote(str(program)))
    assert_exact(hmpim.run(rig, sweep_of(fs, 5)), 0, fs)


@pytest.mark.parametrize("fs", [200.0, *in_studies(50.0, 1000.0)])
def test_the_delay_of_an_fmu_is_exact(fs, fmu):
    assert_exact(hmpim.run(FmuRig(path=str(fmu)), sweep_of(fs, 5)), 3, fs)


@pytest.mark.parametrize("seconds", [5, *in_studies(10)])
@pytest.mark.parametrize("fs", [200.0, *in_studies(50.0, 1000.0)])
def test_a_median_filter_is_called_nonlinear_and_never_wrong_and_ok(fs, seconds):
    median = Median()
    rig = FunctionRig(function=median, mode="sample", reset=median.reset)
    pair = sampled(hmpim.run(rig, sweep_of(fs, seconds)))
    assert "nonlinear" in {warning.code for warning in pair.warnings}
    delay = pair.parameters.delay
    if delay is not None and delay.verdict == "ok":
        low, high = delay.ci95
        assert low * fs <= 2.0 <= high * fs
