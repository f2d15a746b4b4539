"""What `identify` says of systems that are not linear, stepped in time, and of linear ones."""

import importlib
from functools import cache

import numpy as np
import pytest

import hmpim
from hmpim.model.operators import play, rate_limited
from tests_support import in_studies

FS, SUBSTEPS, DELAY = 200.0, 16, 0.03
T = np.arange(2000) / FS


def sweep(t: np.ndarray) -> np.ndarray:
    """0.1 to 20 Hz in 10 s, its amplitude falling from 1 to a quarter."""
    inside = np.maximum(t, 0.0)
    return np.sin(2 * np.pi * (0.1 * inside + 19.9 / 20 * inside**2)) / (1 + 0.3 * inside)


@cache
def motion(kind: str, size: float) -> np.ndarray:
    """Second order, 10 Hz, ζ 0.4, delay 30 ms, by semi-implicit Euler."""
    omega, step = 2 * np.pi * 10.0, 1 / FS / SUBSTEPS
    u = sweep(np.arange(T.size * SUBSTEPS) * step - DELAY).tolist()
    cubic = {"hardening": size, "softening": -size}.get(kind, 0.0)
    square = size if kind == "asymmetry" else 0.0
    grip = step * omega**2 * size if kind == "friction" else 0.0
    y = v = 0.0
    out = np.empty(len(u))
    for k, target in enumerate(u):
        out[k] = y
        v += step * (omega**2 * (target - y - square * y**2 - cubic * y**3) - 0.8 * omega * v)
        v = 0.0 if abs(v) <= grip else v - np.copysign(grip, v)
        y += step * v
    if kind == "backlash":
        out = play(out, size)
    if kind == "rate_limit":
        out = rate_limited(out, size * step)
    return out[::SUBSTEPS]


_KEPT: dict[tuple, hmpim.Identification] = {}


def identified(
    y: np.ndarray, *, noise: float = 0.002, seed: int = 1, structures: list[str] | None = None
) -> hmpim.Identification:
    """A result is never changed: several tests look at it."""
    asked = (y.tobytes(), noise, seed, tuple(structures or ()))
    if asked not in _KEPT:
        _KEPT[asked] = identified_anew(y, noise=noise, seed=seed, structures=structures)
    return _KEPT[asked]


def identified_anew(
    y: np.ndarray, *, noise: float = 0.002, seed: int = 1, structures: list[str] | None = None
) -> hmpim.Identification:
    noisy = y + noise * np.random.default_rng(seed).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": sweep(T)}, {"y": noisy}, fs=FS)
    return hmpim.identify(record, structures=structures)


STEPPED = 10.039
"""Natural frequency in Hz of `motion`, whose steps are explicit in the damping force."""

PLAIN = ["second_order"]
"""For tests of what is said of the rest, not of which structure is chosen."""


def codes(pair) -> set[str]:
    return {warning.code for warning in pair.warnings}


@pytest.mark.parametrize(
    ("kind", "size", "within", "structures"),
    [
        ("friction", 0.01, 0.2, None),
        ("backlash", 0.01, 0.25, PLAIN),
        ("rate_limit", 20.0, 0.15, PLAIN),
        ("hardening", 0.1, 0.25, None),
        ("softening", 0.1, 0.25, None),
        *in_studies(("backlash", 0.01, 0.25, None), ("rate_limit", 20.0, 0.15, None)),
    ],
)
def test_kind_and_size_are_reported(kind, size, within, structures):
    """The figures are those of the linear part, or doubtful."""
    pair = identified(motion(kind, size), structures=structures)["y", "u"]
    assert {"nonlinear", kind} <= codes(pair)
    if kind == "rate_limit":
        assert pair.verdict == "doubtful"
    else:
        assert pair.verdict == "ok"
        linear = identified(motion("none", 0.0), structures=PLAIN)["y", "u"]
        for name in ("natural_frequency", "damping_ratio", "scale_factor"):
            one, other = (getattr(some.parameters, name) for some in (pair, linear))
            assert abs(one.value - other.value) < 4 * np.hypot(one.spread, other.spread)
    found = pair.nonlinearity
    assert found.kinds == (kind,)
    # A spring's size is the share of force at the largest deflection, which is not exactly 1.
    largest = float(np.max(np.abs(motion("none", 0.0))))
    truth = size * largest**2 if kind in ("hardening", "softening") else size
    assert found.size.value == pytest.approx(truth, rel=within)
    assert found.odd > 5 * found.even
    assert found.noise + found.linear + found.nonlinear == pytest.approx(1.0)


def test_what_is_asymmetric_is_even():
    found = identified(motion("asymmetry", 0.1))["y", "u"].nonlinearity
    assert found.kinds == ("asymmetry",)
    assert found.even > 3 * found.odd


def test_a_tiny_one_is_reported_and_modelled():
    pair = identified(motion("hardening", 0.02), noise=0.0005)["y", "u"]
    assert {"nonlinear", "hardening"} <= codes(pair)
    assert pair.nonlinearity.share < 0.005
    assert pair.natural_frequency.verdict == "ok"
    assert pair.natural_frequency.value == pytest.approx(STEPPED, rel=0.001)
    assert pair.noise_std.ci95[0] < 0.0005 < pair.noise_std.ci95[1]


def test_reported_alone_the_linear_model_is_the_best_at_this_amplitude():
    y = motion("hardening", 0.1) + 0.002 * np.random.default_rng(1).standard_normal(T.size)
    record = hmpim.Record.from_arrays({"u": sweep(T)}, {"y": y}, fs=FS)
    linear = hmpim.identify(record, nonlinear="reported")["y", "u"]
    assert {"nonlinear", "hardening"} <= codes(linear)
    assert linear.natural_frequency.value > STEPPED + 0.08  # the spring hardens
    assert linear.verdict == "doubtful"
    modelled = hmpim.identify(record)["y", "u"]
    assert modelled.natural_frequency.value == pytest.approx(STEPPED, abs=0.01)


@pytest.mark.parametrize("kind", ["backlash", "friction", "hardening"])
def test_the_prediction_includes_the_nonlinearity(kind):
    y = motion(kind, 0.02)
    pair = identified(y, structures=PLAIN)["y", "u"]
    assert np.std((pair.prediction - y)[20:]) < 0.0006  # the noise is 0.002


def test_a_rich_structure_gives_way_to_a_plain_one_with_friction():
    pair = identified(motion("friction", 0.03))["y", "u"]
    assert pair.structure == "second_order"
    assert pair.nonlinearity.kinds[0] == "friction"
    chosen = [c for c in pair.candidates if c.chosen]
    assert [c.structure for c in chosen] == ["second_order"]


def test_a_linear_system_has_nothing_to_report():
    pair = identified(motion("none", 0.0), noise=0.02)["y", "u"]
    assert pair.verdict == "ok"
    assert "nonlinear" not in codes(pair)
    found = pair.nonlinearity
    assert (found.share, found.noise, found.kinds, found.harmonics) == (0.0, 1.0, (), ())


def third_harmonic(f: float, level: float, grip: float) -> float:
    """Amplitude that a steady sine of `level` has at 3 f behind friction, stepped in time."""
    omega, steps = 2 * np.pi * 10.0, round(FS * SUBSTEPS / f)
    step = 1 / FS / SUBSTEPS
    u = np.tile(level * np.sin(2 * np.pi * np.arange(steps) / steps), 10).tolist()
    y = v = 0.0
    out = []
    for target in u:
        out.append(y)
        v += step * (omega**2 * (target - y) - 0.8 * omega * v)
        grasp = step * omega**2 * grip
        v = 0.0 if abs(v) <= grasp else v - np.copysign(grasp, v)
        y += step * v
    return float(2 * np.abs(np.fft.rfft(out[-steps:])[3]) / steps)


def test_the_harmonics_are_those_of_a_stepped_sine():
    pair = identified(motion("friction", 0.02), noise=0.0005, structures=PLAIN)["y", "u"]
    curves = pair.nonlinearity.harmonics
    own, third = (next(c for c in curves if c.order == k) for k in (1, 3))
    inner = list(zip(third.frequency, third.amplitude, strict=True))[1:4]
    assert len(inner) == 3
    for f, amplitude in inner:
        level = 1 / (1 + 0.3 * (f - 0.1) / 1.99)  # the sweep's, when it passes f
        truth = third_harmonic(f, level, 0.02)
        # Describing function: a third of 4 F / π, as the dynamics pass it on.
        s = 3 * f / 10.0
        assert truth == pytest.approx(4 * 0.02 / np.pi / 3 / abs(1 - s**2 + 0.8j * s), rel=0.02)
        assert amplitude == pytest.approx(truth, rel=0.3)
    assert own.amplitude[0] == pytest.approx(1.0, rel=0.35)


def test_json_keeps_it_and_older_results_lack_it():
    result = identified(motion("backlash", 0.02), structures=PLAIN)
    data = result.to_dict()
    back = hmpim.Identification.from_dict(data)
    assert back["y", "u"].nonlinearity == result["y", "u"].nonlinearity
    assert data["pairs"][0]["nonlinearity"]["kinds"] == ["backlash"]
    del data["pairs"][0]["nonlinearity"]
    assert hmpim.Identification.from_dict(data)["y", "u"].nonlinearity is None


def test_another_input_at_twice_the_frequency_is_no_harmonic():
    rng = np.random.default_rng(0)
    slow = np.sin(2 * np.pi * (0.1 * T + 0.5 * T**2))
    fast = np.sin(2 * np.pi * (0.2 * T + 1.0 * T**2))  # exactly its second harmonic
    lag = hmpim.Model(delay=0.02, scale_factor=1.0, denominator=(4e-4, 1.6e-2, 1.0))
    y = hmpim.simulate(lag, slow, fs=FS, intersample="bandlimited")
    y = y + 0.3 * hmpim.simulate(lag, fast, fs=FS, intersample="bandlimited")
    record = hmpim.Record.from_arrays(
        {"a": slow, "b": fast}, {"y": y + 0.005 * rng.standard_normal(T.size)}, fs=FS
    )
    for pair in hmpim.identify(record).pairs:
        assert "nonlinear" not in codes(pair)


def test_one_of_several_inputs_that_is_bent_is_told_by_its_harmonics():
    rng = np.random.default_rng(0)
    up = np.sin(2 * np.pi * (0.1 * T + 0.5 * T**2))
    down = up[::-1].copy()
    y = up - 0.2 * up**3 + 0.5 * down + 0.005 * rng.standard_normal(T.size)
    record = hmpim.Record.from_arrays({"a": up, "b": down}, {"y": y}, fs=FS)
    plain = ["static", "first_order"]
    result = hmpim.identify(record, structures=plain, nonlinear="reported")
    assert "nonlinear" in codes(result["y", "a"])
    assert "nonlinear" not in codes(result["y", "b"])
    said = next(w.message for w in result["y", "a"].warnings if w.code == "nonlinear")
    assert "Drive one input at a time" in said


def test_a_long_record_is_looked_at_in_blocks(monkeypatch):
    y = motion("friction", 0.02)
    whole = identified(y, structures=PLAIN)["y", "u"].nonlinearity
    monkeypatch.setattr(
        importlib.import_module("hmpim.identify.nonlinear.nonlinearity"), "LONGEST", 1000
    )
    halved = identified_anew(y, structures=PLAIN)["y", "u"].nonlinearity
    assert halved.kinds == whole.kinds
    assert halved.size.value == pytest.approx(whole.size.value, rel=0.1)
    assert halved.odd == pytest.approx(whole.odd, rel=0.3)


def test_levels_of_a_hard_spring_name_it_and_end_the_linear_range():
    rng = np.random.default_rng(0)
    records = []
    for gain in (1.0, 4.0, 8.0):
        # A deflection `gain` times as large bends a spring as one gain² times as hard would.
        y = gain * motion("hardening", 0.002 * gain**2)
        noisy = y + 0.002 * rng.standard_normal(T.size)
        records.append(hmpim.Record.from_arrays({"u": gain * sweep(T)}, {"y": noisy}, fs=FS))
    levels = hmpim.identify_levels(records, structures=PLAIN)
    found = levels["y", "u"]
    assert found.findings[0].code == "nonlinear"
    reach = next(t for t in found.trends if t.name == "scale_factor")
    assert reach.change < -0.01
    first, last = reach.amplitudes[0], reach.amplitudes[-1]
    assert first <= found.linear_up_to < last
    assert levels.results[0]["y", "u"].verdict == "ok"
    assert levels.results[2]["y", "u"].verdict == "doubtful"


def test_levels_of_a_linear_system_are_all_alike():
    rng = np.random.default_rng(0)
    records = [
        hmpim.Record.from_arrays(
            {"u": gain * sweep(T)},
            {"y": gain * motion("none", 0.0) + 0.01 * rng.standard_normal(T.size)},
            fs=FS,
        )
        for gain in (2.0, 1.0, 4.0)
    ]
    found = hmpim.identify_levels(records, structures=PLAIN)["y", "u"]
    assert found.findings == ()
    assert found.linear_up_to == pytest.approx(4.0 * np.ptp(sweep(T)) / 2)


def test_levels_that_do_not_go_together_are_refused():
    one = hmpim.Record.from_arrays({"u": sweep(T)}, {"y": sweep(T)}, fs=FS)
    other = hmpim.Record.from_arrays({"u": sweep(T)}, {"z": sweep(T)}, fs=FS)
    with pytest.raises(hmpim.HmpimError, match="1 record has nothing"):
        hmpim.identify_levels([one])
    with pytest.raises(hmpim.HmpimError, match="2 records and 1 amplitudes"):
        hmpim.identify_levels([one, one], amplitudes=[1.0])
    with pytest.raises(hmpim.HmpimError, match="record 1 has channels u, z"):
        hmpim.identify_levels([one, other])


@pytest.mark.real_data
def test_the_silverbox_hardens_in_one_record_and_over_levels(measured):
    data = np.load(measured / "silverbox" / "snls80mv.npz")
    fs = 610.3515625

    def part(start: int, stop: int) -> hmpim.Record:
        return hmpim.Record.from_arrays(
            {"u": data["input"][start:stop]}, {"y": data["output"][start:stop]}, fs=fs
        )

    arrow = hmpim.identify(part(28_000, 36_000), structures=PLAIN)["y", "u"]
    assert {"nonlinear", "hardening"} <= codes(arrow)
    assert arrow.verdict == "doubtful"
    assert arrow.nonlinearity.odd > 0.1
    assert arrow.nonlinearity.even == 0.0
    parts = [part(k, k + 3000) for k in (2000, 20_000, 32_000)]
    levels = hmpim.identify_levels(parts, structures=PLAIN)
    found = levels["y", "u"]
    assert [f.code for f in found.findings] == ["nonlinear", "hardening"]
    frequency = next(t for t in found.trends if t.name == "natural_frequency")
    assert frequency.values[0] == pytest.approx(68.35, rel=0.005)
    assert np.all(np.diff(frequency.values) > 0)
    assert frequency.values[-1] == pytest.approx(70.8, rel=0.01)


@pytest.mark.real_data
def test_a_hardening_spring_is_not_taken_for_a_second_mode(measured):
    pair = hmpim.identify(hmpim.read(measured / "silverbox" / "schroeder.csv"))["output", "input"]
    assert pair.structure == "second_order"
    assert pair.damping_ratio.value == pytest.approx(0.0495, abs=0.0005)
    assert pair.damping_ratio.verdict == pair.natural_frequency.verdict == "doubtful"
    assert pair.damping_ratio.ci95 is None
    (finding,) = (found for found in pair.warnings if found.code == "nonlinear")
    assert "hardening spring" in finding.message


@pytest.mark.real_data
def test_hardware_that_is_linear_enough_is_not_doubted_for_it(measured):
    loop = np.load(measured / "emps" / "emps.npz")
    record = hmpim.Record.from_arrays({"u": loop["qg"]}, {"y": loop["qm"]}, time=loop["t"])
    record = record.between(0.0, 5.0)
    pair = hmpim.identify(record, structures=["second_order"])["y", "u"]
    assert pair.nonlinearity.share < 1e-3
    assert "nonlinear" not in codes(pair)


def test_no_harmonic_is_more_than_the_whole_residual():
    """Where the crest of the first, slow cycle is missing, orders may cancel each other there."""
    y = motion("friction", 0.01) + 0.002 * np.random.default_rng(1).standard_normal(T.size)
    level = 0.98 * float(y.max())
    pair = hmpim.identify(
        hmpim.Record.from_arrays({"u": sweep(T)}, {"y": np.minimum(y, level)}, fs=FS),
        structures=PLAIN,
    )["y", "u"]
    left = float(np.std(pair.residual)) / float(np.std(y))
    assert pair.nonlinearity.odd <= 3 * left
    assert pair.nonlinearity.share < 0.1


def cut_from_a_sweep(cubic: float) -> hmpim.Record:
    """A spring's 9 s from a sweep that was on for 3 s before: 12 Hz, ζ 0.56; by Runge-Kutta."""
    rate, fine, samples, before = 100.0, 4, 900, 300
    half = 0.5 / (rate * fine)
    t = np.arange(2 * (samples + before) * fine + 1) * half - before / rate
    force = (10 * np.sin(2 * np.pi * (2.5 * t + 25.5 / 18 * t**2))).tolist()
    omega = 2 * np.pi * 11.7

    def moved(y: float, v: float, f: float) -> tuple[float, float]:
        return v, omega**2 * (f - y * (1 + cubic * y**2 / 100)) - 1.12 * omega * v

    y = v = 0.0
    out = []
    for k in range(0, len(force) - 1, 2):
        out.append(y)
        a = moved(y, v, force[k])
        b = moved(y + half * a[0], v + half * a[1], force[k + 1])
        c = moved(y + half * b[0], v + half * b[1], force[k + 1])
        d = moved(y + 2 * half * c[0], v + 2 * half * c[1], force[k + 2])
        y += half / 3 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
        v += half / 3 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
    seen = slice(before * fine, None, fine)
    noise = 0.006 * np.random.default_rng(1).standard_normal(samples)
    u = np.asarray(force[::2])[: len(out)]
    return hmpim.Record.from_arrays({"u": u[seen]}, {"y": np.asarray(out)[seen] + noise}, fs=rate)


@pytest.mark.parametrize(("cubic", "kind"), [(-0.03, "softening"), (0.06, "hardening")])
def test_a_spring_is_recognised_in_mid_motion(cubic, kind):
    pair = hmpim.identify(cut_from_a_sweep(cubic))["y", "u"]
    assert kind in codes(pair)
    low, high = pair.scale_factor.ci95
    assert pair.scale_factor.verdict == "doubtful" or low < 1.0 < high
    # The state that the record begins with is not carried back before the samples that count.
    assert np.abs(pair.prediction).max() < 12.0
