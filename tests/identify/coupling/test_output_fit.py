"""Several inputs at once: every pair, direct and coupling, from one run."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim.errors import RecordError
from hmpim.identify.coupling import output_fit
from hmpim.identify.coupling.output_fit import _join, _may_drift, _responds, fit_together
from hmpim.identify.coupling.pairs import Pairs
from hmpim.identify.coupling.weak import whitening_of
from hmpim.identify.fitting.joint import joint_fit
from hmpim.stimulus.axes import AxisPlan
from tests_support import in_studies

FS = 200.0
TIME = np.arange(2000) / FS
OWN = ((10.0, 0.4, 0.02), (8.0, 0.5, 0.03), (6.0, 0.7, 0.025))


def sweep(first, last):
    return np.sin(2 * np.pi * (first * TIME + (last - first) / 20 * TIME**2))


PLAIN = ["static", "first_order", "second_order"]
"""For tests of what is found of which input, not of which structure is chosen."""
INPUTS = (sweep(0.1, 20), sweep(0.1, 20)[::-1].copy(), sweep(14, 0.2))


def outputs(coupling, noise_std, seed):
    rng = np.random.default_rng(seed)
    made = []
    for i, (natural, damping, delay) in enumerate(OWN):
        w = 2 * np.pi * natural
        y = 0.1 * i + noise_std * rng.standard_normal(2000)
        for j, u in enumerate(INPUTS):
            model = hmpim.Model(
                delay=delay,
                scale_factor=1.0 if i == j else coupling[i][j],
                denominator=(1 / w**2, 2 * damping / w, 1.0),
            )
            y = y + hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
        made.append(y)
    return made


def record(signals):
    return hmpim.Record.from_arrays(
        {f"u{j}": u for j, u in enumerate(INPUTS)},
        {f"y{i}": y for i, y in enumerate(signals)},
        fs=FS,
        intersample="bandlimited",
    )


@pytest.fixture(scope="module")
def result():
    coupling = np.full((3, 3), 0.05) * np.array([1, -1, 1])
    return coupling, hmpim.identify(record(outputs(coupling, 0.01, 0)))


def test_each_pair_is_found_with_honest_bars(result):
    coupling, found = result
    off = []
    for i in range(3):
        for j in range(3):
            pair = found[f"y{i}", f"u{j}"]
            truth = {
                "scale_factor": 1.0 if i == j else coupling[i, j],
                "delay": OWN[i][2],
                "bias": 0.1 * i,
                "natural_frequency": OWN[i][0],
            }
            assert pair.structure == "second_order"
            for name, value in truth.items():
                estimate = getattr(pair, name)
                off.append((estimate.value - value) / estimate.std)
    assert np.max(np.abs(off)) < 4.5
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(1.0, abs=0.45)


def test_coupling_is_within_half_a_percent_where_usable(result):
    coupling, found = result
    for i in range(3):
        natural, damping, delay = OWN[i]
        for j in range(3):
            response = found[f"y{i}", f"u{j}"].frequency_response
            s = 2j * np.pi * response.frequency
            w = 2 * np.pi * natural
            own = np.exp(-delay * s) / ((s / w) ** 2 + 2 * damping * s / w + 1)
            gain = 1.0 if i == j else coupling[i, j]
            assert response.frequency.size > 50
            error = np.abs(response.response - gain * own)
            assert np.median(error) < 0.005
            assert response.coherence is not None


def test_an_output_that_follows_no_input_is_said_to_be_unrelated():
    noise = np.random.default_rng(0).standard_normal(2000)
    found = hmpim.identify(
        hmpim.Record.from_arrays(
            {f"u{j}": u for j, u in enumerate(INPUTS)},
            {"y0": noise, "y1": INPUTS[0] + 0.01 * noise[::-1]},
            fs=FS,
            intersample="bandlimited",
        ),
        structures=PLAIN,
    )
    for j in range(3):
        assert [w.code for w in found["y0", f"u{j}"].warnings] == ["unrelated"]
    assert found["y1", "u0"].scale_factor.value == pytest.approx(1.0, abs=0.01)


def test_an_output_that_is_one_of_the_inputs_leaves_nothing_to_the_others():
    found = hmpim.identify(
        hmpim.Record.from_arrays(
            {f"u{j}": u for j, u in enumerate(INPUTS)}, {"y": INPUTS[1]}, fs=FS
        ),
        structures=PLAIN,
    )
    assert found["y", "u1"].scale_factor.value == pytest.approx(1.0)
    for j in (0, 2):
        assert [w.code for w in found["y", f"u{j}"].warnings] == ["unrelated"]


def test_an_axis_that_is_not_coupled_is_said_to_be_unrelated():
    coupling = np.zeros((3, 3))
    found = hmpim.identify(record(outputs(coupling, 0.01, 1)))
    for i in range(3):
        for j in range(3):
            pair = found[f"y{i}", f"u{j}"]
            if i == j:
                assert pair.verdict == "ok"
            else:
                assert [w.code for w in pair.warnings] == ["unrelated"]


def test_inputs_that_are_one_and_the_same_are_refused_by_name():
    y = outputs(np.zeros((3, 3)), 0.01, 2)[0]
    rng = np.random.default_rng(0)
    for twin in (2 * INPUTS[0], 2 * INPUTS[0] + 0.01 * rng.standard_normal(2000)):
        both = hmpim.Record.from_arrays({"left": INPUTS[0], "right": twin}, {"y": y}, fs=FS)
        with pytest.raises(RecordError, match="left, right"):
            hmpim.identify(both)


@pytest.mark.parametrize("noise_std", [1e-2, 1e-4, 0.0])
def test_a_coupling_is_given_back_by_the_stronger_one_however_little_noise(noise_std):
    rng = np.random.default_rng(0)
    y = noise_std * rng.standard_normal(2000)
    for (natural, delay, gain), u in zip(
        ((8.0, 0.02, 1.0), (6.0, 0.05, 0.05)), INPUTS, strict=False
    ):
        w = 2 * np.pi * natural
        model = hmpim.Model(delay=delay, scale_factor=gain, denominator=(1 / w**2, 1 / w, 1.0))
        y = y + hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
    both = hmpim.Record.from_arrays(
        {"u0": INPUTS[0], "u1": INPUTS[1]}, {"y": y}, fs=FS, intersample="bandlimited"
    )
    pair = hmpim.identify(both)["y", "u1"]
    for name, value in {"scale_factor": 0.05, "natural_frequency": 6.0, "delay": 0.05}.items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 4 * estimate.std + 1e-4 * value


def test_couplings_are_found_where_no_plainer_structure_is_asked_for():
    """A weak coupling is tried as second order at most, whatever else is asked for."""
    weak = [[1.0 if i == j else 0.1 for j in range(3)] for i in range(3)]
    signals = outputs(weak, 0.02, seed=1)
    result = hmpim.identify(
        hmpim.Record.from_arrays(
            {"u0": INPUTS[0], "u1": INPUTS[1]}, {"y0": signals[0]}, fs=FS, intersample="bandlimited"
        ),
        structures=["second_order", "third_order"],
    )
    assert result["y0", "u0"].structure in ("second_order", "third_order")
    assert result["y0", "u1"].scale_factor.value == pytest.approx(0.1, abs=0.05)


def test_a_late_answer_leaves_fewer_bins_between_two_bands():
    """Of an input beyond the other's band too few may be left for a response of its own."""
    fs, n = 100.0, 1000
    t = np.arange(n) / fs

    def sweep(first, last, t):
        return np.sin(2 * np.pi * (first * t + (last - first) * t**2 / 20.0))

    noise = 0.001 * np.random.default_rng(0).standard_normal(n)
    late = np.where(t >= 1.5, sweep(0.1, 10.0, t - 1.5), 0.0)
    inputs = {"a": sweep(0.1, 10.0, t), "b": sweep(11.9, 0.1, t)}
    y = late + 0.3 * inputs["b"] + noise
    result = hmpim.identify(hmpim.Record.from_arrays(inputs, {"y": y}, fs=fs))
    assert result["y", "a"].delay.value == pytest.approx(1.5, abs=1e-4)
    assert result["y", "b"].delay.value == pytest.approx(0.0, abs=1e-4)


def test_a_weak_coupling_of_software_shares_its_phase_with_no_lag():
    """A lag between samples has no meaning there, and its response is not known."""
    rng = np.random.default_rng(6)
    u, v = rng.standard_normal((2, 400))
    y = lfilter([0.2], [1.0, -0.8], u) + 0.005 * v + 0.01 * rng.standard_normal(400)
    record = hmpim.Record.from_arrays({"u": u, "v": v}, {"y": y}, fs=FS)
    pair = hmpim.identify(record, intersample="sampled")["y", "v"]
    assert abs(pair.scale_factor.value - 0.005) < 3 * pair.scale_factor.std


@pytest.mark.parametrize(
    ("size", "seed", "structures"),
    [
        (-4e-6, 4, {"two_modes"}),  # large enough for the dynamics of both axes
        (-1.5e-7, 5, {"second_order_high_pass", "second_order"}),
    ],
)
def test_a_product_of_inertia_leaves_the_noise_white(size, seed, structures):
    """Torque by the other axis's acceleration, behind the dynamics of both: zero at DC."""
    rng = np.random.default_rng(seed)
    poles = [np.array([(2 * np.pi * f) ** -2, z / (np.pi * f), 1.0]) for f, z, _ in OWN[:2]]
    made = []
    for i, (_, _, delay) in enumerate(OWN[:2]):
        direct = hmpim.Model(delay=delay, scale_factor=1.0, denominator=tuple(poles[i]))
        coupled = hmpim.Model(
            delay=delay,
            scale_factor=size,
            numerator=(1.0, 0.0, 0.0),
            denominator=tuple(np.polymul(*poles)),
        )
        parts = zip((direct, coupled), (INPUTS[i], INPUTS[1 - i]), strict=True)
        answer = sum(hmpim.simulate(m, u, fs=FS, intersample="bandlimited") for m, u in parts)
        made.append(answer + 0.001 * rng.standard_normal(TIME.size))
    found = hmpim.identify(
        hmpim.Record.from_arrays(
            {f"u{j}": u for j, u in enumerate(INPUTS[:2])},
            {f"y{i}": y for i, y in enumerate(made)},
            fs=FS,
            intersample="bandlimited",
        )
    )
    for i in range(2):
        own, other = found[f"y{i}", f"u{i}"], found[f"y{i}", f"u{1 - i}"]
        assert (own.structure, own.verdict) == ("second_order", "ok")
        assert own.noise_std.value == pytest.approx(0.001, abs=4 * own.noise_std.std)
        assert other.structure in structures
        if other.structure == "second_order_high_pass":
            assert other.scale_factor.unit == "s^2"
            assert other.scale_factor.ci95[1] < 0.0
        elif other.structure == "two_modes":
            assert abs(other.scale_factor.value) < 4.0 * other.scale_factor.spread
    assert {found["y0", "u1"].structure, found["y1", "u0"].structure} & (
        structures - {"second_order"}
    )


@pytest.mark.parametrize("small", [1.0, 1e-5])
def test_noise_is_that_without_what_follows_the_inputs_in_any_unit(small):
    rng = np.random.default_rng(0)
    u, v = lfilter([1.0], [1.0, -0.8], rng.standard_normal((2, 4000)))
    rest = 0.3 * lfilter([1.0], [1.0, -0.5], rng.standard_normal(4000))
    alone = whitening_of(rest)
    gain = whitening_of(rest + u - 2.0 * v, (u, small * v))
    assert np.median(gain / alone) == pytest.approx(1.0, abs=0.02)
    assert np.percentile(np.abs(gain / alone - 1.0), 95) < 0.25


def test_of_more_inputs_than_a_window_separates_all_counts_as_noise():
    rng = np.random.default_rng(0)
    inputs = list(rng.standard_normal((12, 1000)))
    rest = np.cumsum(rng.standard_normal(1000))
    gain = whitening_of(rest, inputs)
    assert gain[0] == pytest.approx(whitening_of(rest)[0], rel=0.5)
    assert np.all(np.isfinite(gain))


def test_identical_inputs_are_one():
    rng = np.random.default_rng(0)
    u, rest = rng.standard_normal(2000), np.cumsum(rng.standard_normal(2000))
    one, two = whitening_of(rest + 50.0 * u, (u,)), whitening_of(rest + 50.0 * u, (u, u))
    assert two == pytest.approx(one, rel=0.1)


def test_a_high_pass_alone_may_be_stated_for_inputs_that_do_not_follow():
    rng = np.random.default_rng(2)
    y = hmpim.simulate(
        hmpim.Model(
            delay=0.02,
            scale_factor=1e-3,
            numerator=(1.0, 0.0, 0.0),
            denominator=(1e-3, 0.04, 1.0),
        ),
        INPUTS[0],
        fs=FS,
        intersample="bandlimited",
    )
    record = hmpim.Record.from_arrays(
        {"u0": INPUTS[0], "u1": INPUTS[1]},
        {"y": y + 0.001 * rng.standard_normal(y.size)},
        fs=FS,
        intersample="bandlimited",
    )
    found = hmpim.identify(record, structures=["second_order_high_pass"])
    assert found["y", "u0"].structure == "second_order_high_pass"
    assert found["y", "u1"].parameters.scale_factor is None


@pytest.mark.parametrize("seed", [3, *in_studies(8)])
def test_couplings_to_inputs_that_are_alike_at_low_frequencies_are_both_found(seed):
    limits = hmpim.Limits(position=5.0, velocity=200.0, acceleration=8000.0, unit="deg")
    tops = {"roll": 80.0, "yaw": 60.0, "pitch": 50.0, "azimuth": 30.0, "elevation": 30.0}
    plans = [AxisPlan(axis=axis, limits=limits, band=(0.2, top)) for axis, top in tops.items()]
    designed = hmpim.design_axes(plans, duration=10.0, fs=500.0)
    inputs = {axis: one.position for axis, one in zip(tops, designed, strict=True)}
    w = 2 * np.pi * 20.0
    models = {
        "yaw": hmpim.Model(delay=0.005, scale_factor=0.01, denominator=(0.01, 1.0)),
        "pitch": hmpim.Model(delay=0.005, scale_factor=1.0, denominator=(w**-2, 1.4 / w, 1.0)),
        "elevation": hmpim.Model(delay=0.012, scale_factor=0.02, denominator=(0.03, 1.0)),
    }
    y = 0.2 + 0.02 * np.random.default_rng(seed).standard_normal(5000)
    for axis, model in models.items():
        y = y + hmpim.simulate(model, inputs[axis], fs=500.0, intersample="bandlimited")
    driven = {axis: inputs[axis] for axis in models}
    found = hmpim.identify(
        hmpim.Record.from_arrays(driven, {"y": y}, fs=500.0, intersample="bandlimited"),
        structures=PLAIN,
    )
    for axis, model in models.items():
        gain, lag = found["y", axis].scale_factor, found["y", axis].delay_low_frequency
        assert gain.value == pytest.approx(model.scale_factor, abs=4 * gain.spread)
        late = model.delay + model.denominator[-2]
        assert lag.value == pytest.approx(late, abs=4 * lag.spread)


def second_order(u, fs, delay, frequency, damping):
    w = 2 * np.pi * frequency
    model = hmpim.Model(delay=delay, scale_factor=1.0, denominator=(1 / w**2, 2 * damping / w, 1.0))
    return hmpim.simulate(model, u, fs=fs, intersample="bandlimited")


def test_the_weaker_input_is_fitted_again_once_the_leading_one_has_joined():
    # The leading input's first fit explains the drift, so it is left out at first.
    rng = np.random.default_rng(3)
    n, fs = 1200, 100.0
    t = np.arange(n) / fs
    fade = np.sin(0.5 * np.pi * np.clip(np.minimum(t, t[-1] - t) / 0.5, 0, 1)) ** 2
    u0 = fade * np.sin(2 * np.pi * (0.1 * t + 11.9 / 2 / t[-1] * t**2))
    u1 = np.convolve(rng.standard_normal(n), np.ones(5) / 3, "same")
    frequency, late = rng.uniform(2, 8), rng.uniform(0.02, 0.2)
    y = second_order(u0, fs, late, frequency, 0.5)
    other = rng.uniform(0.02, 0.2)
    y = y + 0.6 * second_order(u1, fs, other, rng.uniform(2, 8), 0.5)
    slow = np.polynomial.legendre.legval(
        np.linspace(-1, 1, n), np.r_[0, rng.standard_normal(6) * 0.5 ** np.arange(6)]
    )
    y = y + slow / np.std(slow) + 0.01 * rng.standard_normal(n)
    found = hmpim.identify(hmpim.Record.from_arrays({"u0": u0, "u1": u1}, {"y": y}, fs=fs))
    for name, delay in (("u0", late), ("u1", other)):
        pair = found["y", name]
        assert (pair.structure, pair.verdict) == ("second_order", "ok")
        assert abs(pair.delay.value - delay) < 1e-3


@pytest.mark.parametrize("seed", [10, 5])
def test_plain_fits_made_once_more_spare_a_drift_and_whole_searches(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    inputs = []
    for _ in range(4):
        noise = np.convolve(rng.standard_normal(1000), np.hanning(5) / 3, "same")
        inputs.append(noise * np.clip((np.arange(1000) - 10) / 20, 0, 1))
    y = np.zeros(1000)
    for gain, u in zip((1.0, 0.9, 0.8, 0.7), inputs, strict=True):
        late, frequency, damping = rng.uniform([0.01, 6.0, 0.2], [0.3, 30.0, 1.0])
        y = y + gain * second_order(u, 100.0, late, frequency, damping)
    y = y + 0.03 * np.std(y) * rng.standard_normal(1000)
    made = []

    def fitted(u, y, **options):
        made.append(len(options["structures"]) > 3)
        return joint_fit(u, y, **options)

    monkeypatch.setattr(output_fit, "joint_fit", fitted)
    named = {f"u{j}": u for j, u in enumerate(inputs)}
    found = hmpim.identify(hmpim.Record.from_arrays(named, {"y": y}, fs=100.0))
    assert {pair.structure for pair in found.pairs} == {"second_order"}
    assert sum(made) == len(inputs)
    assert len(made) < 4 * len(inputs)


@pytest.mark.parametrize(("slow", "expected"), [(1.5, True), (0.0, False)])
def test_a_drift_is_tried_only_if_it_explains_much_of_what_is_left(slow, expected):
    rng = np.random.default_rng(0)
    y = 0.01 * rng.standard_normal(2000) + slow * np.linspace(-1, 1, 2000) ** 3
    for u, (natural, damping, delay) in zip(INPUTS[:2], OWN, strict=False):
        y = y + second_order(u, FS, delay, natural, damping)
    pairs = Pairs(y=y, valid=None, fits={}, strong=[], alike=())
    for i, u in enumerate(INPUTS[:2]):  # a mode is missing
        rest = pairs.without_others(i)
        options = {"intersample": "bandlimited", "structures": ("first_order",)}
        pairs.put(i, joint_fit(u, rest, **options, growing=False))
        pairs.strong.append(i)
    pairs.refine(pairs.kept, None)
    assert whitening_of(pairs.residual()) is not None
    assert _may_drift(pairs) == expected


def test_inputs_found_beside_a_drift_are_fitted_without_it_too(monkeypatch):
    rng = np.random.default_rng(0)
    y = second_order(INPUTS[0], FS, 0.02, 8.0, 0.5) + 0.5 * second_order(
        INPUTS[1], FS, 0.03, 6, 0.7
    )
    y = y + 0.01 * rng.standard_normal(2000)
    options = {"known": None, "intersample": "bandlimited", "structures": ("second_order",)}
    monkeypatch.setattr(output_fit, "_join", lambda *_: None)
    monkeypatch.setattr(output_fit, "_may_drift", lambda _: True)
    steady = []

    def fit_drift(led, steady_of):
        (leading,) = led.values()
        other = joint_fit(INPUTS[1], y - leading.best.fit.prediction, **options)
        steady.append(steady_of({**led, 1: other}))
        return steady[0]

    found = fit_together(list(INPUTS[:2]), y, valid=None, **options, fit_drift=fit_drift)
    assert found is steady[0]
    assert found.strong == (True, True)
    assert abs(found.fits[1].best.fit.delay / FS - 0.03) < 1e-3


def test_a_full_search_is_not_repeated_for_a_change_below_the_noise():
    rng = np.random.default_rng(5)
    u, noise = rng.standard_normal(500), 0.1 * rng.standard_normal(500)
    fit = joint_fit(u, u + noise, intersample="zoh", structures=("static",), growing=False)
    pairs = Pairs(y=u + noise, valid=None, fits={}, strong=[0], alike=())
    pairs.put(0, fit)
    rest, one_sample = pairs.without_others(0), np.zeros(500)
    one_sample[300] = np.sqrt(pairs.cost)
    assert pairs.is_new(0, rest, None)
    assert not pairs.is_new(0, rest + 0.9 * one_sample + 7.0, None)
    assert pairs.is_new(0, rest + 1.1 * one_sample, None)


@pytest.mark.parametrize("seed", [1, *in_studies(0)])
def test_a_noisy_copy_does_not_lead_where_the_record_begins_in_motion(seed):
    rng = np.random.default_rng(seed)
    u = np.convolve(rng.standard_normal(1600), np.hanning(9) / 4, "same")
    copy = np.r_[np.zeros(7), u[:-7]] + 0.1 * rng.standard_normal(1600)
    y = second_order(u, 100.0, 0.05, 1.0, 0.05)
    inside = slice(400, 1000)
    found = hmpim.identify(
        hmpim.Record.from_arrays(
            {"u": u[inside], "copy": copy[inside]},
            {"y": y[inside] + 0.02 * rng.standard_normal(600)},
            fs=100.0,
            intersample="bandlimited",
        ),
        structures=PLAIN,
    )
    assert found["y", "copy"].verdict == "not_identifiable"
    assert abs(found["y", "u"].delay.value - 0.05) < 0.002


def test_the_delay_of_a_program_with_two_inputs_is_a_known_number_of_samples():
    rng = np.random.default_rng(0)
    u, v = rng.standard_normal((2, 1200))
    y = 0.7 * np.r_[np.zeros(5), u[:-5]] + 0.4 * np.r_[np.zeros(3), v[:-3]]
    record = hmpim.Record.from_arrays(
        {"u": u, "v": v}, {"y": y + 0.01 * rng.standard_normal(1200)}, fs=100.0
    )
    found = hmpim.identify(record, intersample="sampled")
    for name, late in (("u", 5), ("v", 3)):
        delay = found["y", name].delay
        assert (round(delay.value * 100, 9), delay.std) == (late, 0.0)


@pytest.fixture(scope="module")
def coupled():
    """A leading input and a coupling of second order, each with its own fit."""
    rng = np.random.default_rng(0)
    weak = 0.1 * second_order(INPUTS[2], FS, 0.02, 6.0, 0.3) + 1e-4 * rng.standard_normal(2000)
    y = second_order(INPUTS[0], FS, 0.02, 8.0, 0.5) + weak
    lead, coupling = (
        joint_fit(u, part, intersample="bandlimited", structures=("second_order",))
        for u, part in ((INPUTS[0], y - weak), (INPUTS[2], weak))
    )
    return y, lead, coupling


@pytest.mark.parametrize("known", [True, False])
def test_an_input_stays_a_coupling_if_plain_dynamics_explain_less(coupled, known):
    y, lead, coupling = coupled
    pairs = Pairs(y=y, valid=None, fits={}, strong=[0], alike=())
    for i, fit in enumerate((lead, coupling) if known else (lead,)):
        pairs.put(i, fit)
    plainly = partial(joint_fit, intersample="bandlimited", structures=("first_order",))
    _join([INPUTS[0], INPUTS[2]], pairs, plainly)
    assert pairs.strong == ([0] if known else [0, 1])


@pytest.mark.parametrize(("share", "responds"), [(0.4, True), (0.6, False)])
def test_a_response_that_leaves_out_most_of_the_record_is_no_response(coupled, share, responds):
    _, _, coupling = coupled
    late = replace(coupling, problem=replace(coupling.problem, begins=int(share * TIME.size)))
    assert _responds(INPUTS[2], late, joint_fit, summed=False) is responds
