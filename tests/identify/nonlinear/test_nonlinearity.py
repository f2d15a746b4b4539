"""Kinds of nonlinearity told apart on physics stepped in time, and on measured records."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from hmpim import Record, identify
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.plainer import plainer
from hmpim.identify.nonlinear.mechanisms import compare_mechanisms
from hmpim.identify.nonlinear.nonlinearity import inspect_nonlinearity
from hmpim.identify.records.levels import compare_levels
from hmpim.identify.threads import one_thread
from hmpim.model import STRUCTURES, prepare_input
from hmpim.model.operators import play, rate_limited
from hmpim.rigs import Sensor
from tests_support import assert_share, in_studies

FS = 200.0
T = np.arange(2000) / FS
START = np.array([6.0, np.log(0.8 / (2 * np.pi * 10) * FS), 1 / (4 * 0.16)])


def chirp(t: np.ndarray) -> np.ndarray:
    return np.where(t > 0, np.sin(2 * np.pi * (0.1 * t + 19.9 / 20 * t * t)), 0.0)


def gentle(t: np.ndarray) -> np.ndarray:
    return chirp(t) / (1 + 0.3 * np.maximum(t, 0.0))


def physics(drive, kind: str, size: float, *, substeps: int = 16) -> np.ndarray:
    """Second order, 10 Hz, ζ 0.4, delay 30 ms, with one nonlinearity, by semi-implicit Euler."""
    omega, step = 2 * np.pi * 10.0, 1 / FS / substeps
    u = drive(np.arange(T.size * substeps) * step - 0.03).tolist()
    cubic = size if kind == "spring" else 0.0
    grip = step * omega**2 * size if kind == "friction" else 0.0
    y = v = 0.0
    out = np.empty(T.size)
    for k, target in enumerate(u):
        if k % substeps == 0:
            out[k // substeps] = y
        v += step * (omega**2 * (target - y - cubic * y**3) - 0.8 * omega * v)
        v = 0.0 if abs(v) <= grip else v - np.copysign(grip, v)
        y += step * v
    match kind:
        case "backlash":
            return play(out, size)
        case "rate":
            return rate_limited(out, size / FS)
        case "clip":
            return np.clip(out, -size, size)
        case "square":
            return out + size * out**2
        case "cube":
            return out - size * out**3
    return out


def inspected(drive, y):
    u = drive(T)
    with one_thread():
        joint = joint_fit(u, y, intersample="bandlimited")
        found = inspect_nonlinearity(
            u, joint.problem, joint.best.fit, fs=FS, plain=plainer(joint), unit="deg"
        )
    return found, {f.code: f.message for f in found.findings}


@pytest.mark.parametrize(
    ("kind", "size", "code"),
    [
        ("spring", 0.1, "hardening"),
        ("clip", 0.7, "saturation"),
        # Small: in test_nonlinear_end_to_end.py.
        *in_studies(("spring", -0.1, "softening"), ("rate", 25.0, "rate_limit")),
        *in_studies(("friction", 0.01, "friction"), ("friction", 0.04, "friction")),
        *in_studies(("backlash", 0.02, "backlash"), ("backlash", 0.1, "backlash")),
    ],
)
def test_each_kind_is_named(kind, size, code):
    noise = 0.005 * np.random.default_rng(1).standard_normal(T.size)
    found, said = inspected(gentle, physics(gentle, kind, size) + noise)
    assert list(said) == ["nonlinear", code]
    assert "odd harmonics" in said["nonlinear"]
    best = found.seen.mechanisms[0]
    match kind:
        case "spring":
            # The force at the largest deflection of about 1; the linear fit takes some of it.
            assert 0.5 * abs(size) < best.size < 1.5 * abs(size)
        case "rate":
            assert best.size == pytest.approx(size, abs=2.5 * best.size_std)
        case _:
            assert best.size == pytest.approx(size, rel=0.35)
    assert found.summary.noise + found.summary.linear + found.summary.nonlinear == pytest.approx(
        1.0
    )
    assert found.summary.nonlinear > 0.03


def test_even_and_odd_curves_of_the_scale_are_told_apart():
    noise = 0.005 * np.random.default_rng(1).standard_normal(T.size)
    even, said = inspected(gentle, physics(gentle, "square", 0.05) + noise)
    assert even.seen.mechanisms[0].kind == "asymmetry"
    assert even.seen.mechanisms[0].size == pytest.approx(0.05, rel=0.25)
    assert list(said) == ["nonlinear"]
    assert "even harmonics" in said["nonlinear"]
    odd, said = inspected(gentle, physics(gentle, "cube", 0.1) + noise)
    assert odd.seen.mechanisms[0].kind == "curvature"
    assert "odd harmonics" in said["nonlinear"]


def test_what_is_tiny_is_measured_but_no_warning():
    noise = 1e-4 * np.random.default_rng(1).standard_normal(T.size)
    found, said = inspected(gentle, physics(gentle, "friction", 0.001) + noise)
    assert said == {}
    assert found.seen.harmonics.probability(1) < 1e-5


def inputs(kind: str, rng: np.random.Generator):
    match kind:
        case "sweep":
            return chirp(T), "bandlimited"
        case "binary":
            return rng.choice([-1.0, 1.0], 400).repeat(5), "zoh"
        case "noise":
            low = butter(4, 20, fs=FS, output="sos")
            return sosfilt(low, rng.standard_normal(T.size)), "bandlimited"
        case _:
            k = 0.5 * np.arange(1, 40)[:, None]
            phase = rng.uniform(0, 6, k.shape)
            return np.cos(2 * np.pi * k * T + phase).sum(axis=0) / 6, "bandlimited"


@pytest.mark.parametrize(
    ("colour", "kind"),
    [
        *((0.0, kind) for kind in ("sweep", "binary", "noise", "multisine")),
        (0.9, "sweep"),
        *in_studies(*((0.9, kind) for kind in ("binary", "noise", "multisine"))),
    ],
)
def test_a_linear_system_raises_no_alarm(seeds, kind, colour):
    count = seeds + seeds // 2 if kind == "sweep" else max(seeds // 4, 10)
    alarms = []
    with one_thread():
        for seed in range(count):
            u, between = inputs(kind, np.random.default_rng(seed))
            sensor = Sensor(
                delay=0.03,
                natural_frequency=10,
                damping_ratio=0.4,
                noise_std=0.1,
                noise_colour=colour,
            )
            y = sensor.respond(u, fs=FS, intersample=between, rng=seed)
            source = prepare_input(u, between)
            problem = Problem(source=source, y=y, valid=None, longest_delay=100.0)
            fit = fit_structure(problem, STRUCTURES["second_order"], START)
            alarms.append(bool(inspect_nonlinearity(u, problem, fit, fs=FS).findings))
    assert_share(alarms, at_most=0.01)


@pytest.mark.parametrize("kind", ["sweep", "binary", "noise", "multisine"])
def test_a_linear_misfit_is_not_called_nonlinear(kind):
    for seed in range(3):
        u, between = inputs(kind, np.random.default_rng(seed))
        first = Sensor(delay=0.03, natural_frequency=10, damping_ratio=0.4)
        second = Sensor(natural_frequency=25, damping_ratio=0.2, noise_std=0.003)
        y = second.respond(first.respond(u, fs=FS, intersample=between), fs=FS, rng=seed)
        source = prepare_input(u, between)
        problem = Problem(source=source, y=y, valid=None, longest_delay=100.0)
        fit = fit_structure(problem, STRUCTURES["second_order"], START)
        assert np.std(fit.residual) > 0.05 * np.std(y)
        assert inspect_nonlinearity(u, problem, fit, fs=FS).findings == ()


def test_kinds_are_told_without_a_sweep_too():
    rng = np.random.default_rng(3)
    u, _ = inputs("noise", rng)
    u = u / np.abs(u).max()

    def drive(t):
        return np.interp(t, T, u, left=0.0)

    noise = 0.002 * rng.standard_normal(T.size)
    for kind, size, code in (("spring", 0.5, "hardening"), ("backlash", 0.03, "backlash")):
        y = physics(drive, kind, size) + noise
        problem = Problem(source=prepare_input(u, "foh"), y=y, valid=None, longest_delay=100.0)
        fit = fit_structure(problem, STRUCTURES["second_order"], START)
        found = inspect_nonlinearity(u, problem, fit, fs=FS)
        assert found.seen.harmonics is None
        assert found.findings[1].code == code


def test_a_periodic_input_shows_even_distortion():
    k = np.arange(1, 100, 2)[:, None]
    phase = np.random.default_rng(0).uniform(0, 6, k.shape)
    u = np.tile(np.cos(2 * np.pi * k * np.arange(1000) / 1000 + phase).sum(axis=0) / 5, 5)
    y = u + 0.03 * u**2 + 0.01 * np.random.default_rng(1).standard_normal(u.size)
    problem = Problem(source=prepare_input(u, "foh"), y=y, valid=None, longest_delay=100.0)
    fit = fit_structure(problem, STRUCTURES["static"], np.zeros(1))
    found = inspect_nonlinearity(u, problem, fit, fs=FS)
    assert found.seen.mechanisms[0].kind == "asymmetry"
    assert "even in the deflection" in found.findings[0].message


def test_the_size_of_a_nonlinearity_scales_with_the_units():
    noise = 0.005 * np.random.default_rng(1).standard_normal(T.size)
    y = physics(gentle, "friction", 0.02) + noise
    u = gentle(T)
    sizes = []
    for scale in (1.0, 1000.0):
        source = prepare_input(u * scale, "bandlimited")
        problem = Problem(source=source, y=y * scale, valid=None, longest_delay=100.0)
        fit = fit_structure(problem, STRUCTURES["second_order"], START)
        best = compare_mechanisms(problem, fit, fs=FS)[0]
        assert best.kind == "friction"
        sizes.append(best.size / scale)
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-4)


@pytest.mark.real_data
@pytest.mark.study  # small: one record and all levels, in test_nonlinear_end_to_end.py
def test_the_silverbox_hardens(measured):
    data = np.load(measured / "silverbox" / "snls80mv.npz")
    u, y, fs = data["input"], data["output"], 610.3515625
    spans = [(2000, 8000), (8000, 14000), (14000, 20000), (20000, 26000), (32000, 38000)]
    pairs, peaks = [], []
    for start, stop in spans:
        record = Record.from_arrays(
            {"u": u[start:stop]}, {"y": y[start:stop]}, fs=fs, intersample="bandlimited"
        )
        pairs.append(identify(record, structures=["second_order"])["y", "u"])
        peaks.append(float(np.abs(y[start:stop]).max()))
    first = pairs[0]
    # Resonance and damping at small amplitude.
    assert first.natural_frequency.value == pytest.approx(68.35, rel=0.005)
    assert first.damping_ratio.value == pytest.approx(0.048, rel=0.05)
    levels = compare_levels([pair.parameters for pair in pairs], peaks)
    assert [f.code for f in levels.findings] == ["nonlinear", "hardening"]
    trend = next(t for t in levels.trends if t.name == "natural_frequency")
    assert np.all(np.diff(trend.values) > 0)
    assert trend.values[-1] == pytest.approx(70.8, rel=0.01)
    for start, stop in spans[1:]:
        with one_thread():
            joint = joint_fit(
                u[start:stop],
                y[start:stop],
                intersample="bandlimited",
                structures=("second_order",),
            )
            found = inspect_nonlinearity(u[start:stop], joint.problem, joint.best.fit, fs=fs)
        assert [f.code for f in found.findings] == ["nonlinear", "hardening"]
        assert "odd" in found.findings[0].message
        assert found.summary.nonlinear > 0.5


@pytest.mark.real_data
def test_friction_in_a_tight_loop_is_no_large_nonlinearity(measured):
    data = np.load(measured / "emps" / "emps.npz")
    u, y = np.ravel(data["qg"]), np.ravel(data["qm"])
    with one_thread():
        joint = joint_fit(u, y, intersample="bandlimited", structures=("second_order",))
        found = inspect_nonlinearity(u, joint.problem, joint.best.fit, fs=1000.0)
    assert found.findings == ()
    assert found.seen.rms < 1e-3 * np.std(y)
