import numpy as np
import pytest
from scipy import signal

from hmpim.identify.frf.columns import Columns
from hmpim.identify.frf.local import local_response, local_responses
from hmpim.identify.frf.rational import Regressors
from tests_support import in_studies

FS, BAND, DELAY = 200.0, (0.1, 20.0), 0.15
FINE = 32
Record = tuple[np.ndarray, np.ndarray]


def chirp(t: np.ndarray) -> np.ndarray:
    t = np.maximum(t, 0.0)
    return np.sin(2 * np.pi * (0.1 * t + 0.995 * t**2))


def second_order(f: np.ndarray, damping: float = 0.4) -> np.ndarray:
    s, w = 2j * np.pi * f, 2 * np.pi * 10
    # The input of `clean_record` is joined linearly over 1/6400 s, a low-pass of its own.
    joined = np.sinc(f / (FS * FINE)) ** 2
    return joined * w**2 / (s**2 + 2 * damping * w * s + w**2) * np.exp(-s * DELAY)


def clean_record(damping: float) -> Record:
    """docs/field.md's system without noise; the input is linear over 1/6400 s."""
    fine, w = FINE, 2 * np.pi * 10
    t = np.arange(2000 * fine) / (FS * fine)
    matrices = ([[0, 1], [-(w**2), -2 * damping * w]], [[0], [w**2]], [[1.0, 0]], [[0.0]])
    step = signal.cont2discrete(tuple(map(np.array, matrices)), 1 / (FS * fine), "foh")
    numerator, denominator = signal.ss2tf(*step[:4])
    return chirp(np.arange(2000) / FS), signal.lfilter(numerator[0], denominator, chirp(t - DELAY))[
        ::fine
    ] + 0.6


@pytest.fixture(scope="module")
def records() -> dict[float, Record]:
    """Input and noise-free output by damping ratio."""
    return {damping: clean_record(damping) for damping in (0.4, 0.05)}


def study(
    record: Record, damping: float, noise: float, seeds: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    u, clean = record
    errors, stds = [], []
    for seed in range(seeds):
        y = clean + noise * np.random.default_rng(seed).standard_normal(clean.size)
        found = local_response(u, y, FS, band=BAND, delay=DELAY)
        errors.append(np.abs(found.response - second_order(found.frequency, damping)))
        stds.append(found.std)
    return found.frequency, np.array(errors), np.array(stds)


def test_median_error_on_the_field_record_is_at_most_2_percent_for_every_seed(
    records: dict[float, Record], seeds: int
) -> None:
    f, error, _ = study(records[0.4], 0.4, 0.1, seeds + seeds // 2)
    relative = (error / np.abs(second_order(f)))[:, f >= 0.5]
    per_seed = np.median(relative, axis=1)
    assert per_seed.max() <= 0.02
    assert np.median(per_seed) < 0.01


@pytest.mark.few(30)
@pytest.mark.parametrize(
    ("noise", "damping"),
    [(0.1, 0.05), (0.01, 0.4), *in_studies((0.1, 0.4), (0.01, 0.05), (1e-4, 0.4))],
)
def test_stated_errors_agree_with_the_scatter(
    records: dict[float, Record], noise: float, damping: float, seeds: int
) -> None:
    _, error, std = study(records[damping], damping, noise, seeds)
    # |error|/std is Rayleigh distributed: half lie within 0.83 of one, 98 % within two.
    assert np.median(error) / np.median(std) / np.sqrt(np.log(2)) == pytest.approx(1, abs=0.15)
    assert np.mean(error < 2 * std) > 0.94


@pytest.mark.parametrize("noise", [0.1, 1e-4, *in_studies(0.01)])
def test_the_stated_error_holds_at_a_sharp_resonance(
    records: dict[float, Record], noise: float, seeds: int
) -> None:
    f, error, std = study(records[0.05], 0.05, noise, seeds)
    near = np.abs(f - 10) < 2
    ratio = np.sqrt(np.mean(error[:, near] ** 2) / np.mean(std[:, near] ** 2))
    assert ratio == pytest.approx(1, abs=0.15)


@pytest.mark.few(30)
@pytest.mark.parametrize("noise", [0.01, 1e-4])
def test_the_stated_error_holds_in_the_lowest_bins(
    records: dict[float, Record], noise: float, seeds: int
) -> None:
    f, error, std = study(records[0.4], 0.4, noise, seeds)
    low = f < 1
    ratio = np.sqrt(np.mean(error[:, low] ** 2) / np.mean(std[:, low] ** 2))
    assert ratio == pytest.approx(1, abs=0.2)


def test_without_noise_a_second_order_system_is_found_nearly_exactly(
    records: dict[float, Record],
) -> None:
    f, error, _ = study(records[0.4], 0.4, 0.0, 1)
    relative = error[0] / np.abs(second_order(f))
    assert np.median(relative) < 1e-6


def test_an_integrator_is_followed_to_the_lowest_bin() -> None:
    rng = np.random.default_rng(4)
    u = rng.standard_normal(2000)
    y = np.cumsum(u) / FS  # z / (z - 1), over the rate
    found = local_response(u, y, FS, band=(0.2, 10.0))
    z = np.exp(2j * np.pi * found.frequency / FS)
    true = z / (z - 1) / FS
    error = np.abs(found.response / true - 1)
    assert error[:5].max() < 2e-3
    assert np.median(error) < 3e-4
    assert error.max() < 0.05


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_do_not_matter(factor: float, records: dict[float, Record]) -> None:
    u, clean = records[0.4]
    y = clean + 0.1 * np.random.default_rng(2).standard_normal(clean.size)
    one = local_response(u, y, FS, band=BAND, delay=DELAY)
    other = local_response(u / factor, factor * y, FS, band=BAND, delay=DELAY)
    np.testing.assert_allclose(other.response, factor**2 * one.response, rtol=1e-6)
    np.testing.assert_allclose(other.std, factor**2 * one.std, rtol=1e-5)


@pytest.mark.parametrize("orders", [(2,), (2, 3), (3, 1, 2)])
@pytest.mark.parametrize("plain", [False, True])
def test_normal_equations_are_those_of_the_columns_written_out(
    orders: tuple[int, ...], plain: bool
) -> None:
    """Of three outputs and four windows, over A and without."""
    rng = np.random.default_rng(0)

    def drawn(*shape: int) -> np.ndarray:
        return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)

    x, carriers = np.linspace(-1.0, 1.0, 21), drawn(4, len(orders), 21)
    columns = Columns.of(carriers, orders, x)
    over, fitted, left = drawn(4, 3, 21), drawn(4, 3, 21), drawn(4, 3, 21)
    over = np.ones_like(over) if plain else over
    gram, right = columns.normal(None if plain else over, np.abs(over) ** 2, fitted, left)
    linear = [
        carriers[:, a, None] * over * x**p for a, most in enumerate(orders) for p in range(most + 1)
    ]
    rows = np.stack([*linear, -fitted * over * x, -fitted * over * x**2], axis=-2)
    mirror = np.conj(rows)
    assert gram == pytest.approx(mirror @ rows.swapaxes(-1, -2), rel=1e-12, abs=1e-12)
    assert right == pytest.approx(mirror @ left[..., None], rel=1e-12, abs=1e-12)


def test_what_the_input_alone_says_is_made_once_for_all_outputs_of_one_delay(
    records: dict[float, Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    original = Columns.of

    def counted(*args: object) -> Columns:
        made.append(args)
        return original(*args)

    monkeypatch.setattr(Columns, "of", counted)
    u, clean = records[0.4]
    noise = 0.1 * np.random.default_rng(0).standard_normal((1, clean.size))
    local_responses(u, clean + noise, FS, band=BAND, delays=np.full(1, DELAY))
    of_one = len(made)
    alike = np.repeat(clean + noise, 30, axis=0)
    local_responses(u, alike, FS, band=BAND, delays=np.full(30, DELAY))
    assert len(made) == 2 * of_one > 0


def test_narrow_windows_are_fitted_only_where_wide_ones_fall_short(
    records: dict[float, Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    widths = []
    original = Regressors.around

    def noted(u: np.ndarray, centre: np.ndarray, width: int) -> Regressors:
        widths.append(width)
        return original(u, centre, width)

    monkeypatch.setattr(Regressors, "around", noted)
    u, clean = records[0.4]
    y = clean + 0.1 * np.random.default_rng(0).standard_normal(clean.size)
    local_response(u, y, FS, band=BAND, delay=DELAY)
    assert len(widths) == 2
    widths.clear()
    # Three sharp modes within half the band.
    time = np.arange(2000) / FS
    modes = sum(np.exp(-0.6 * time) * np.sin(2 * np.pi * f * time) for f in (4.0, 8.0, 14.0))
    local_response(u, np.convolve(u, modes)[: u.size], FS, band=BAND)
    assert len(widths) == 3
