from typing import Any

import numpy as np
import pytest
from scipy import signal

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.frf.local import local_response
from hmpim.identify.frf.multivariable import JointResponse, joint_response
from tests_support import in_studies

FS, N, FINE = 200.0, 2000, 32
BAND = (0.5, 19.5)
FINE_TIME = np.arange(N * FINE) / (FS * FINE)


def sweep(first: float, last: float, *, seconds: float = 10.0) -> np.ndarray:
    """Linear sweep on the fine grid, 0 outside its time."""
    t = FINE_TIME
    phase = 2 * np.pi * (first * t + (last - first) / (2 * seconds) * t**2)
    return np.where(t <= seconds, np.sin(phase), 0.0)


UP = sweep(0.1, 20.0)
DOWN = np.concatenate(([0.0], UP[:0:-1]))
FAST = sweep(0.1, 40.0)


def through(drive: np.ndarray, natural: float, damping: float, delay: float) -> np.ndarray:
    """Output on the coarse grid of a second-order system; the input is linear over 1/6400 s."""
    w = 2 * np.pi * natural
    matrices = ([[0, 1], [-(w**2), -2 * damping * w]], [[0], [w**2]], [[1.0, 0]], [[0.0]])
    step = signal.cont2discrete(tuple(map(np.array, matrices)), 1 / (FS * FINE), "foh")
    numerator, denominator = signal.ss2tf(*step[:4])
    late = round(delay * FS * FINE)
    moved = np.concatenate((np.zeros(late), drive[: drive.size - late]))
    return signal.lfilter(numerator[0], denominator, moved)[::FINE]


def second_order(f: np.ndarray, natural: float, damping: float, delay: float) -> np.ndarray:
    s, w = 2j * np.pi * f, 2 * np.pi * natural
    return w**2 / (s**2 + 2 * damping * w * s + w**2) * np.exp(-s * delay)


# Natural frequency, damping ratio and delay of three axes, and of what couples into each.
DIRECT = ((10.0, 0.4, 0.150), (12.0, 0.6, 0.120), (8.0, 0.5, 0.155))
COUPLED = ((14.0, 0.7, 0.150), (9.0, 0.5, 0.120), (11.0, 0.6, 0.155))
COUPLING = 0.05


@pytest.fixture(scope="module")
def three_axes() -> tuple[np.ndarray, np.ndarray]:
    """Inputs and noise-free outputs of three axes driven at once, 5 % into each from the others."""
    drives = (UP, DOWN, FAST)
    outputs = [
        sum(
            through(drive, *DIRECT[i]) if i == j else COUPLING * through(drive, *COUPLED[i])
            for j, drive in enumerate(drives)
        )
        + 0.5 * (i - 1)
        for i in range(3)
    ]
    return np.stack([drive[::FINE] for drive in drives]), np.stack(outputs)


def true_response(f: np.ndarray, i: int) -> np.ndarray:
    """Response of one axis to each of the three, (f, 3)."""
    rows = [COUPLING * second_order(f, *COUPLED[i]) for _ in range(3)]
    rows[i] = second_order(f, *DIRECT[i])
    return np.stack(rows, axis=1)


def alone(u: np.ndarray, y: np.ndarray, delay: float = 0.0, **options: Any) -> JointResponse:
    names = [f"input {k}" for k in range(len(u))] + ["output"]
    given = {"band": BAND, "valid": None, "predicted": np.zeros(y.size), "names": names, **options}
    return joint_response(u, y, FS, delay=delay, **given)


def each(u: np.ndarray, y: np.ndarray, **options: Any) -> list[JointResponse]:
    """The responses of all three axes."""
    return [alone(u, own, axis[2], **options) for own, axis in zip(y, DIRECT, strict=True)]


def usable(found: JointResponse) -> float:
    """Share of the frequencies at which the inputs are separated."""
    return found.inputs[0].frequency.size / found.frequency.size


def together(found: JointResponse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequency, and the responses to all inputs with their errors, (f, m)."""
    response = np.stack([r.response for r in found.inputs], axis=1)
    std = np.stack([r.std for r in found.inputs], axis=1)
    return found.inputs[0].frequency, response, std


def errors(found: JointResponse, i: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of the responses of one axis, and what they are stated to be."""
    frequency, response, std = together(found)
    return np.abs(response - true_response(frequency, i)), std


def measured(
    three_axes: tuple[np.ndarray, np.ndarray], noise: float, seed: int
) -> list[JointResponse]:
    u, clean = three_axes
    return each(u, clean + noise * np.random.default_rng(seed).standard_normal(clean.shape))


def off(i: int) -> np.ndarray:
    return np.arange(3) != i


def test_couplings_of_three_axes_are_within_half_a_percent_of_the_direct_gain(
    three_axes: tuple[np.ndarray, np.ndarray],
) -> None:
    coupled = []
    for seed in range(5):
        for i, found in enumerate(measured(three_axes, 0.01, seed)):
            assert usable(found) > 0.9
            coupled.append(errors(found, i)[0][:, off(i)].ravel())
    assert np.mean(np.concatenate(coupled) < 0.005) > 0.995


def test_without_noise_couplings_are_nearly_exact(
    three_axes: tuple[np.ndarray, np.ndarray],
) -> None:
    for i, found in enumerate(measured(three_axes, 0.0, 0)):
        error, _ = errors(found, i)
        assert np.median(error[:, off(i)]) < 3e-4
        assert error.max() < 0.003


@pytest.mark.parametrize("noise", [0.1, *in_studies(0.01)])
def test_stated_errors_agree_with_the_scatter(
    three_axes: tuple[np.ndarray, np.ndarray], noise: float, seeds: int
) -> None:
    parts: dict[bool, list[tuple[np.ndarray, np.ndarray]]] = {True: [], False: []}
    for seed in range(max(seeds // 10, 5)):
        for i, found in enumerate(measured(three_axes, noise, seed)):
            error, std = errors(found, i)
            for coupled, part in ((True, off(i)), (False, ~off(i))):
                parts[coupled].append((error[:, part].ravel(), std[:, part].ravel()))
    for pairs in parts.values():
        error, std = (np.concatenate(values) for values in zip(*pairs, strict=True))
        ratio = np.sqrt(np.mean(error**2) / np.mean(std**2))
        assert ratio == pytest.approx(1, abs=0.15)
        assert np.mean(error < 2 * std) > 0.94


def test_coherences_say_what_drives_what(three_axes: tuple[np.ndarray, np.ndarray]) -> None:
    u, clean = three_axes
    y = clean + 0.01 * np.random.default_rng(0).standard_normal(clean.shape)
    y[2] = np.random.default_rng(1).standard_normal(N)  # an output that follows nothing
    y[1] = through(DOWN, *DIRECT[1]) + 0.01 * np.random.default_rng(2).standard_normal(N)
    all_of_them, one_of_them, none = each(u, y)
    for found in (all_of_them, one_of_them):
        assert found.multiple_coherence[found.frequency < 15].min() > 0.98
    assert np.median(none.multiple_coherence) < 0.1
    own = all_of_them.inputs[0]
    assert own.coherence[own.frequency < 15].min() > 0.98
    assert np.median(one_of_them.inputs[0].coherence) < 0.1
    assert np.median(one_of_them.inputs[1].coherence) > 0.98


def test_one_input_gives_what_the_single_estimate_gives(
    three_axes: tuple[np.ndarray, np.ndarray],
) -> None:
    u = three_axes[0][0]
    y = through(UP, *DIRECT[0]) + 0.01 * np.random.default_rng(0).standard_normal(N)
    found = alone(u[None], y, 0.15)
    (many,) = found.inputs
    one = local_response(u, y, FS, band=BAND, delay=0.15)
    np.testing.assert_allclose(many.frequency, one.frequency)
    apart = np.abs(many.response - one.response)
    assert np.all(apart < 4 * np.hypot(many.std, one.std))
    assert np.median(apart) < np.median(one.std)
    assert usable(found) == 1.0


def test_units_and_order_of_the_channels_do_not_matter(
    three_axes: tuple[np.ndarray, np.ndarray],
) -> None:
    u, clean = three_axes
    y = clean + 0.01 * np.random.default_rng(0).standard_normal(clean.shape)
    scale_u, scale_y = np.array([1.0, 50.0, 0.02]), np.array([1e3, 1.0, 1e-3])
    turned = each((u * scale_u[:, None])[::-1], y * scale_y[:, None])
    for one, two, size in zip(each(u, y), turned, scale_y, strict=True):
        (frequency, response, _), (same, other, _) = together(one), together(two)
        np.testing.assert_array_equal(same, frequency)
        back = other[:, ::-1] * scale_u / size
        np.testing.assert_allclose(back, response, rtol=1e-4, atol=1e-6)


def test_inputs_alike_in_part_of_the_band_are_refused_there() -> None:
    # Both sweep alike until 5 s, at 10 Hz; then one goes on and the other turns back.
    t = np.arange(N) / FS
    phase = 2 * np.pi * (0.1 * t + 0.995 * t**2)
    one = np.sin(phase)
    rng = np.random.default_rng(0)
    other = np.where(t < 5, one, 0.0)
    late = signal.sosfilt(
        signal.butter(6, (11, 19), "bandpass", fs=FS, output="sos"), rng.standard_normal(N)
    )
    other = other + np.where(t >= 5, late, 0.0)
    u = np.stack((one, other))
    y = np.array([1.0, 0.3]) @ u + 0.01 * rng.standard_normal(N)
    found = alone(u, y, band=(0.5, 19.0))
    frequency, response, std = together(found)
    assert frequency.min() > 8
    assert np.mean(np.isin(found.frequency[found.frequency > 12], frequency)) > 0.9
    error = np.abs(response - [1.0, 0.3])
    assert np.mean(error < 3 * std) > 0.95


@pytest.mark.parametrize("factor", [1.0, -3.0])
def test_inputs_that_are_the_same_are_named(factor: float) -> None:
    u = np.stack((UP[::FINE], DOWN[::FINE], factor * UP[::FINE]))
    names = ("roll", "pitch", "yaw", "y")
    with pytest.raises(RecordError, match=r"^roll, yaw move alike over the whole band"):
        alone(u, u[0], names=names)
    total = np.stack((u[0], u[1], u[0] + u[1]))
    with pytest.raises(RecordError, match=r"^roll, pitch, yaw move alike"):
        alone(total, u[0], names=names)


U = np.stack((UP[::FINE], DOWN[::FINE]))


@pytest.mark.parametrize(
    ("band", "message"),
    [
        ((1.0, 2.0), "holds 11 bins of 0.1 Hz, too few for 2 inputs"),
        ((1.0, 101.0), "band is"),
    ],
)
def test_bad_bands_are_refused(band: tuple[float, float], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        alone(U, U[0], band=band)


def test_gaps_cost_accuracy_and_the_error_says_so(
    three_axes: tuple[np.ndarray, np.ndarray],
) -> None:
    u, clean = three_axes
    wrong, stds, whole = [], [], []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        valid = np.ones(N, dtype=bool)
        for start in rng.integers(0, N - 60, 8):
            valid[start : start + 50] = False
        y = clean + 0.01 * rng.standard_normal(clean.shape)
        for i, axis in enumerate(DIRECT):
            broken = np.where(valid, y[i], 99.0)
            found = alone(u, broken, axis[2], valid=valid, predicted=clean[i])
            frequency, response, std = together(found)
            wrong.append(np.abs(response[frequency < 8.0]))  # the model misses nothing
            stds.append(std[frequency < 8.0])
            frequency, _, std = together(alone(u, y[i], axis[2], predicted=clean[i]))
            whole.append(std[frequency < 8.0])
    error, std = np.concatenate(wrong), np.concatenate(stds)
    assert np.mean(error < 2 * std) > 0.9
    assert np.sqrt(np.mean(error**2)) < 1.5 * np.sqrt(np.mean(std**2))
    assert np.median(std) > np.median(np.concatenate(whole))


def test_a_lost_output_is_refused(three_axes: tuple[np.ndarray, np.ndarray]) -> None:
    u, clean = three_axes
    with pytest.raises(RecordError, match="output has 0 valid samples"):
        alone(u, clean[0], valid=np.zeros(N, dtype=bool))
