"""Products of filtered signals from statistics alone, against sums over the samples themselves."""

import numpy as np
import pytest
from scipy.signal import lfilter

from hmpim import Record, Statistics, compress
from hmpim.identify.statistics.products import Products, Responses
from hmpim.identify.statistics.reach import AHEAD

LAGS = 60


def recorded(seed: int, size: int) -> Record:
    rng = np.random.default_rng(seed)
    u = 3.0 + 0.1 * np.cumsum(rng.standard_normal(size))
    y = lfilter([0.0, 0.0, 0.3], [1.0, -0.8], u) - seed + 0.1 * rng.standard_normal(size)
    return Record.from_arrays({"u": u}, {"y": y}, fs=100.0)


def stacked(records, statistics, products, responses):
    """Rows, output and bias rows of all runs, sample by sample, whitened and cut."""
    made, outputs, biases = [], [], []
    count, per_run = len(records), statistics.reach.rows
    for i, record in enumerate(records):
        u, y = record.inputs[0].values, record.outputs[0].values
        moved = u - u[0]
        last = u.size
        if products.to_the_end:
            moved = np.append(moved, 2 * moved[-1] - moved[-2 : -2 - AHEAD : -1])
        else:
            last -= AHEAD
        x = np.array([np.convolve(moved, row)[AHEAD : AHEAD + u.size] for row in responses.rows])
        x = x + responses.kept[:, None] * np.cumsum(u)
        own = statistics.reach.fixed(0, u.size)
        bias = np.zeros((count * per_run, u.size))
        bias[i * per_run : (i + 1) * per_run] = own
        if statistics.bias == "common":
            x, bias = x + responses.steady[:, None] * u[0], own
        for kept, signal in ((made, x), (outputs, y), (biases, bias)):
            kept.append(lfilter(products.noise, [1.0], signal)[..., products.first : last])
    return np.hstack(made), np.hstack(outputs), np.hstack(biases)


@pytest.mark.parametrize("noise", [[1.0], [1.0, -0.5, 0.3, 0.1]])
@pytest.mark.parametrize("skipped", [LAGS, 0])
@pytest.mark.parametrize("kind", ["own", "common", "knots"])
@pytest.mark.parametrize("integrates", [False, True])
@pytest.mark.parametrize("to_the_end", [False, True])
def test_products_are_those_of_the_samples(to_the_end, integrates, kind, skipped, noise):
    records = [recorded(1, 700), recorded(2, 900)]
    knots = (0.0, 3.0, 6.0) if kind == "knots" else ()
    bias = "common" if kind == "common" else "own"
    parts = [compress(r, lags=LAGS, knots=knots, bias=bias) for r in records]
    statistics = parts[0] + parts[1]
    products = Products(statistics, skipped=skipped, to_the_end=to_the_end).whitened(
        np.array(noise)
    )
    rng = np.random.default_rng(5)
    decay = np.exp(-np.arange(statistics.reach.taps) / 9.0)
    rows = rng.standard_normal((3, decay.size)) * decay
    responses = Responses.ending(rows, np.array([1.0, 0.0, 0.5]))
    if integrates:
        rows[:, AHEAD:] += np.array([[0.02], [0.0], [-0.3]])
        responses = Responses.integrating(rows)
    x, y, n = stacked(records, statistics, products, responses)
    inverse = np.linalg.pinv(n @ n.T)
    x_left = x - (x @ n.T) @ inverse @ n
    y_left = y - (y @ n.T) @ inverse @ n
    moments = products.moments(responses)
    assert products.counted == y.size
    gram = x_left @ x_left.T
    assert moments.gram == pytest.approx(gram, abs=1e-10 * np.abs(gram).max())
    assert moments.cross == pytest.approx(x_left @ y_left, rel=1e-9)
    assert moments.energy == pytest.approx(y_left @ y_left, rel=1e-10)
    if kind == "common":
        weights = np.array([0.3, -0.2, 0.1])
        assert moments.bias - moments.bias_rows @ weights == pytest.approx(
            (inverse @ n @ (y - weights @ x))[0], rel=1e-9
        )


@pytest.mark.parametrize("skipped", [LAGS, 0])
@pytest.mark.parametrize("kept", [0.0, 0.01])
@pytest.mark.parametrize("to_the_end", [False, True])
def test_what_is_left_over_is_that_of_the_samples(to_the_end, kept, skipped):
    record = recorded(1, 700)
    statistics = compress(record, lags=LAGS)
    plain = Products(statistics, skipped=skipped, to_the_end=to_the_end)
    response = np.zeros(statistics.reach.taps)
    response[AHEAD + 2 :] = 0.3 * 0.8 ** np.arange(response.size - AHEAD - 2)
    u, y = record.inputs[0].values, record.outputs[0].values
    left = y - y[0] - np.convolve(u - u[0], response)[AHEAD : AHEAD + u.size] - 0.2
    left -= kept * np.cumsum(u)
    gram, count, heads, tails = plain.left_over(response, kept, np.array([[0.2]]))
    order = gram.shape[0] - 1
    assert tails[0] == pytest.approx(left[-tails.shape[1] :], rel=1e-9)
    left = left if to_the_end else left[:-AHEAD]
    past = np.stack([left[skipped + order - k : left.size - k] for k in range(order + 1)])
    assert count == past.shape[1]
    assert gram == pytest.approx(past @ past.T, rel=1e-8)
    assert heads[0, :50] == pytest.approx(left[:50], rel=1e-9)


def arrays(statistics: Statistics) -> dict[str, np.ndarray]:
    run = statistics.runs[0]
    names = ("uu", "vu", "vv", "head_u", "tail_u", "head_y", "tail_y", "level")
    return {name: getattr(run, name) for name in names}


@pytest.mark.parametrize("seed", range(6))
def test_blocks_of_any_size_give_what_one_call_gives(seed):
    record = recorded(3, 2000)
    knots = (0.0, 5.0, 12.0) if seed % 2 else ()
    once = compress(record, lags=LAGS, knots=knots)
    u, y = record.inputs[0].values, record.outputs[0].values
    cuts = np.unique(np.random.default_rng(seed).integers(2, 2000, 3 * 4 ** (seed // 2)))
    head = Record.from_arrays({"u": u[: cuts[0]]}, {"y": y[: cuts[0]]}, fs=100.0)
    grown = compress(head, lags=LAGS, knots=knots)
    for block in np.split(np.arange(2000), cuts)[1:]:
        assert grown.update(u[block], y[block]) is grown
    assert grown.samples == once.samples
    for name, values in arrays(once).items():
        scale = np.abs(values).max()
        assert arrays(grown)[name] == pytest.approx(values, abs=1e-9 * scale), name
