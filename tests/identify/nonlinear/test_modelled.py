"""Nonlinearities that are part of the model: the linear part's figures, and the size."""

from functools import cache

import numpy as np
import pytest
import scipy

import hmpim
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear import rows
from hmpim.identify.nonlinear.rows import Command, dead_zone, linear_part, linear_part_finely
from hmpim.model import STRUCTURES, prepare_input
from hmpim.model.fine import FINE
from hmpim.model.nonlinear import NonlinearPart
from hmpim.model.operators import play
from tests_support import in_studies

FS, DELAY, OMEGA, ZETA = 200.0, 0.03, 2 * np.pi * 10.0, 0.4
T = np.arange(1600) / FS
MODEL = hmpim.Model(
    delay=DELAY, scale_factor=1.5, denominator=(OMEGA**-2, 2 * ZETA / OMEGA, 1.0), bias=0.2
)
LINEAR = {"delay": DELAY, "scale_factor": 1.5, "natural_frequency": 10.0, "damping_ratio": ZETA}


def sweep(t: np.ndarray) -> np.ndarray:
    inside = np.maximum(t, 0.0)
    return np.sin(2 * np.pi * (0.1 * inside + 1.3 * inside**2))


def paper_sweep(t: np.ndarray) -> np.ndarray:
    """Its amplitude falls with frequency, so that a linear fit absorbs most of a nonlinearity."""
    return np.asarray(_paper_sweep()(np.maximum(t, 0.0)))


@cache
def _paper_sweep() -> scipy.interpolate.BSpline:
    waveform = hmpim.Sweep(band=(0.1, 20.0), duration=8.0, gain=1.0, extinction=1.0)
    fine = np.linspace(0.0, T[-1], 8 * T.size)
    moves = waveform.motion(fine).position
    return scipy.interpolate.make_interp_spline(fine, moves / np.max(np.abs(moves)))


def forced(force, command=sweep) -> np.ndarray:
    """Deflection of a unit with another force, over the linear one's stiffness, by Runge-Kutta."""

    def rates(t, state):
        y, v = state
        return [v, OMEGA**2 * (float(command(t - DELAY)) - y - force(y)) - 2 * ZETA * OMEGA * v]

    solved = scipy.integrate.solve_ivp(
        rates, (0.0, T[-1]), [0.0, 0.0], t_eval=T, rtol=1e-8, atol=1e-10
    )
    return 1.5 * solved.y[0] + 0.2


def rubbed(grip: float, command=sweep) -> np.ndarray:
    """The same with dry friction, exact over short steps; it stops where it turns."""
    steps = 96
    time = (np.arange(T.size * steps) + 0.5) / (FS * steps)
    rates = np.array([[0, 1, 0], [-(OMEGA**2), -2 * ZETA * OMEGA, OMEGA**2], [0, 0, 0]])
    (a, b, p), (c, d, q), _ = scipy.linalg.expm(rates / (FS * steps)).tolist()
    y = v = 0.0
    out = []
    for target in command(time - DELAY).tolist():
        out.append(y)
        way = v if v != 0.0 else target - y
        if v == 0.0 and abs(target - y) <= grip:
            continue
        driven = target - np.copysign(grip, way)
        y, faster = a * y + b * v + p * driven, c * y + d * v + q * driven
        v = 0.0 if faster * v < 0.0 else faster
    return 1.5 * np.array(out[::steps]) + 0.2


def motion(kind: str, size: float) -> np.ndarray:
    fine = 16
    t = np.arange(T.size * fine) / (FS * fine)
    if kind == "dead_zone":
        u = sweep(t)
        lived = np.sign(u) * np.maximum(np.abs(u) - size, 0.0)
        return hmpim.simulate(MODEL, lived, fs=FS * fine, intersample="foh")[::fine]
    if kind == "backlash":
        linear = hmpim.simulate(MODEL, sweep(t), fs=FS * fine, intersample="foh")
        return play(linear, size)[::fine]
    if kind == "curvature":
        linear = hmpim.simulate(MODEL, sweep(T), fs=FS, intersample="bandlimited") - 0.2
        return linear + size * linear**3 + 0.2
    if kind == "friction":
        return rubbed(size / 1.5)
    sign = 1.0 if kind == "hardening" else -1.0
    return forced(lambda y: sign * size * y**3)


def recorded(y: np.ndarray, seed: int, noise: float = 0.01, command=sweep) -> hmpim.Record:
    y = y + noise * np.random.default_rng(seed).standard_normal(T.size)
    return hmpim.Record.from_arrays({"u": command(T)}, {"y": y}, fs=FS, intersample="bandlimited")


KINDS = [
    ("backlash", 0.05),
    ("dead_zone", 0.08),
    ("friction", 0.03),
    ("hardening", 0.05),
    ("softening", 0.04),
    ("curvature", 0.03),
]


@pytest.mark.parametrize(("kind", "size"), KINDS)
def test_the_figures_are_those_of_the_linear_part(kind, size):
    clean = motion(kind, size)
    pair = hmpim.identify(recorded(clean, 1))["y", "u"]
    (said,) = [warning for warning in pair.warnings if warning.code == kind]
    assert said.severity == "info"
    assert said.message.startswith("The model includes")
    assert pair.structure == "second_order"
    assert pair.verdict == "ok"
    for name, truth in LINEAR.items():
        figure = getattr(pair.parameters, name)
        assert abs(figure.value - truth) < 4 * figure.spread, name
        assert figure.spread < 0.01 * truth, name
    assert pair.noise_std.value == pytest.approx(0.01, rel=0.1)
    assert np.std(pair.prediction - clean) < 0.003  # also while it waits
    if kind in ("backlash", "dead_zone", "friction"):
        words = said.message.split()
        place = words.index("±")
        found, std = float(words[place - 1]), float(words[place + 1].rstrip("."))
        assert abs(found - size) < 4 * std + 0.01 * size


@pytest.mark.few(3)
@pytest.mark.parametrize(("kind", "size"), [KINDS[0], *in_studies(*KINDS[1:])])
def test_the_stated_errors_are_the_scatter(kind, size, seeds):
    clean, errors = motion(kind, size), []
    for seed in range(seeds):
        found = hmpim.identify(recorded(clean, 100 + seed))["y", "u"].parameters
        figures = [(getattr(found, name), truth) for name, truth in LINEAR.items()]
        errors += [(figure.value - truth) / figure.spread for figure, truth in figures]
    assert 0.4 < float(np.sqrt(np.mean(np.square(errors)))) < 1.5


def test_a_trace_in_noise_that_passes_for_white_is_modelled():
    """The linear fit absorbs most of the friction: damping is 9 % too high without it."""
    record = recorded(rubbed(0.008, paper_sweep), 1, noise=0.015, command=paper_sweep)
    linear = hmpim.identify(record, nonlinear="reported")["y", "u"]
    assert linear.damping_ratio.value > 1.07 * ZETA
    assert is_white(linear.residual)
    pair = hmpim.identify(record)["y", "u"]
    assert pair.verdict == "ok"
    assert pair.nonlinear_part is not None
    assert pair.nonlinear_part.kind == "friction"
    low, high = pair.damping_ratio.ci95
    assert low < ZETA < high


def test_kinds_about_as_likely_are_named_and_covered():
    record = recorded(forced(lambda y: -0.03 * y**3, paper_sweep), 4, 0.015, paper_sweep)
    pair = hmpim.identify(record)["y", "u"]
    (said,) = [w for w in pair.warnings if w.message.startswith("The model includes")]
    assert "instead: the intervals allow for it" in said.message
    for name, truth in LINEAR.items():
        low, high = getattr(pair.parameters, name).ci95
        assert low < truth < high, name


def test_of_a_linear_unit_nothing_is_modelled():
    y = hmpim.simulate(MODEL, sweep(T), fs=FS, intersample="bandlimited")
    pair = hmpim.identify(recorded(y, 3))["y", "u"]
    assert not {warning.code for warning in pair.warnings} & {kind for kind, _ in KINDS}


def test_what_no_row_stands_for_stays_doubtful():
    """A scale with a jump in it: no kind leaves white noise."""
    y = hmpim.simulate(MODEL, sweep(T), fs=FS, intersample="bandlimited")
    pair = hmpim.identify(recorded(y + 0.15 * (y > 0.7), 3))["y", "u"]
    assert pair.verdict == "doubtful"
    assert not any(w.message.startswith("The model includes") for w in pair.warnings)


@pytest.mark.parametrize("begins", [None, 0])
def test_the_linear_part_between_the_samples(begins):
    """It is the response of the model to the input between its samples."""
    u = sweep(T)
    y = hmpim.simulate(MODEL, u, fs=FS, intersample="bandlimited")
    data = Problem(
        source=prepare_input(u, "bandlimited", rest=begins is None),
        y=y,
        valid=None,
        longest_delay=20.0,
        begins=begins,
    )
    start = np.array([DELAY * FS, np.log(2 * ZETA / OMEGA * FS), np.log(FS**2 / OMEGA**2)])
    fit = fit_structure(data, STRUCTURES["second_order"], start)
    fine = linear_part_finely(data, fit)
    np.testing.assert_allclose(fine[::FINE], linear_part(data, fit), atol=1e-6)
    late = hmpim.Model(
        delay=fit.delay / FS - 0.5 / FS, scale_factor=1.5, denominator=MODEL.denominator
    )
    middle = hmpim.simulate(late, u, fs=FS, intersample="bandlimited")
    np.testing.assert_allclose(fine[FINE // 2 :: FINE][50:], middle[50:-1], atol=2e-3)


def test_a_standard_deviation_beyond_which_the_model_is_unstable_is_no_step_of_a_derivative():
    """A slow sine says little of dynamics, so that their error bars reach to unstable ones."""
    t = np.arange(1200) / 100.0
    u = 5.0 * np.sin(2 * np.pi * (0.5 + 0.001 * t) * t)
    slow = 0.4 * np.pi  # 20 Hz, per sample
    unit = hmpim.Model(
        delay=0.008,
        scale_factor=1.0,
        denominator=(slow**-2 / 100.0**2, 1.4 / slow / 100.0, 1.0),
        nonlinear=NonlinearPart(kind="friction", at="force", size=0.005, std=0.0, reach=5.0),
    )
    y = hmpim.simulate(unit, u, fs=100.0, intersample="bandlimited")
    y += 0.0005 * np.random.default_rng(76).standard_normal(t.size)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0)).pairs[0]
    assert pair.nonlinear_part is not None
    assert np.isfinite(pair.nonlinear_part.std)


SERVO = {"natural_frequency": 12.0, "damping_ratio": 0.6, "delay": 0.012, "scale_factor": 1.1}
BELOW = np.polymul(
    [(2 * np.pi * 12.0) ** -2, 2 * 0.6 / (2 * np.pi * 12.0), 1.0], [0.02, 1.0]
)  # with a lag of 20 ms
LAGS = {"of the loop": BELOW[0] / BELOW[1], "of the command": 0.02}


def servo(lag: float, friction: float = 0.03) -> np.ndarray:
    """Motion of a servo of third order, by steps of time."""
    part = NonlinearPart(
        kind="friction", at="force", size=friction, std=0.0, reach=1.0, between="foh", lag=lag
    )
    fine = 8
    unit = hmpim.Model(
        delay=0.012, scale_factor=1.1, denominator=tuple(BELOW), bias=0.2, nonlinear=part
    )
    t = np.arange(T.size * fine) / (FS * fine)
    return unit.simulate(sweep(t), t, intersample="foh")[::fine]


@pytest.mark.parametrize("rounding", [0.01, *in_studies(0.0)])
@pytest.mark.parametrize("place", sorted(LAGS))
def test_friction_in_a_servo_whose_force_lags(place, rounding):
    """Also behind a coarse encoder, whose rounding error is most of the residual, and not white."""
    clean = servo(LAGS[place])
    y = clean + 0.003 * np.random.default_rng(5).standard_normal(T.size)
    y = np.round(y / rounding) * rounding if rounding else y
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": sweep(T)}, {"y": y}, fs=FS))["y", "u"]
    assert pair.structure == "third_order"
    assert pair.verdict == "ok"
    for name, truth in SERVO.items():
        figure = getattr(pair.parameters, name)
        assert abs(figure.value - truth) < 4 * figure.spread + 1e-3 * truth, name
        assert figure.spread < 0.01 * truth, name
    part = pair.nonlinear_part
    assert part.kind == "friction"
    assert part.size == pytest.approx(0.03, abs=4 * part.std + 0.0005)
    assert part.lag == pytest.approx(LAGS[place], rel=0.03)
    assert np.std(pair.prediction - clean) < 0.001


def test_stated_structures_are_kept_to():
    y = servo(LAGS["of the loop"]) + 0.003 * np.random.default_rng(5).standard_normal(T.size)
    record = hmpim.Record.from_arrays({"u": sweep(T)}, {"y": y}, fs=FS)
    pair = hmpim.identify(record, structures=["first_order", "second_order"])["y", "u"]
    assert pair.structure in ("first_order", "second_order")
    assert pair.nonlinear_part is None or pair.nonlinear_part.lag == 0.0


def test_friction_of_the_leading_input_of_several():
    """Next to a coupling from another input, which friction would hide."""
    t = np.arange(T.size) / FS
    other = np.sin(2 * np.pi * (4.0 * t - 0.22 * t**2))
    coupled = hmpim.Model(delay=0.02, scale_factor=0.02, denominator=(0.01, 1.0))
    moved = hmpim.simulate(coupled, other, fs=FS, intersample="bandlimited")
    y = servo(LAGS["of the loop"]) + moved
    y += 0.003 * np.random.default_rng(6).standard_normal(T.size)
    inputs = {"u": sweep(T), "other": other}
    result = hmpim.identify(
        hmpim.Record.from_arrays(inputs, {"y": y}, fs=FS, intersample="bandlimited"),
        structures=["first_order", "second_order", "third_order"],
    )
    pair, coupling = result["y", "u"], result["y", "other"]
    assert pair.verdict == "ok"
    assert pair.nonlinear_part.kind == "friction"
    assert coupling.nonlinear_part is None
    for name, truth in SERVO.items():
        figure = getattr(pair.parameters, name)
        assert abs(figure.value - truth) < 4 * figure.spread + 2e-3 * truth, name
    gain = coupling.parameters.scale_factor
    assert abs(gain.value - 0.02) < 4 * gain.spread
    assert gain.spread < 0.002


def test_a_dead_zone_that_newton_does_not_find_is_given_up_early(monkeypatch):
    """Of noise, each step suggests another width."""
    u = sweep(T)
    y = hmpim.simulate(MODEL, u, fs=FS, intersample="bandlimited")
    joint = joint_fit(u, y + np.random.default_rng(3).normal(0.0, 0.03, y.size))
    taken = []

    def counted(*given):
        taken.append(given)
        return fit_structure(*given)

    monkeypatch.setattr(rows, "fit_structure", counted)
    command = Command(u=u, intersample="bandlimited")
    assert dead_zone(command, joint.problem, joint.best.fit) is None
    assert len(taken) < rows.TURNS
