"""Statistics as a value: size, equality, what can be joined, and what is refused."""

import numpy as np
import pytest

import hmpim
from hmpim import HmpimError, Record, compress


def recorded(seed=1, size=1500, **more):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(size)
    y = np.convolve(u, [0.0, 0.5, 0.3])[:size] + 0.05 * rng.standard_normal(size)
    return Record.from_arrays({"u": u}, {"y": y}, fs=100.0, **more)


def test_size_does_not_grow_with_the_length_of_a_run():
    short, long = compress(recorded(size=500), lags=50), compress(recorded(size=9000), lags=50)
    assert short.nbytes == long.nbytes < 16_000  # 6 kB are of the input's cube
    assert (short + long).nbytes == 2 * short.nbytes
    assert (short + long).samples == 9500


def test_equal_by_value_and_not_hashed():
    assert compress(recorded(), lags=50) == compress(recorded(), lags=50)
    assert compress(recorded(), lags=50) != compress(recorded(), lags=51)
    assert compress(recorded(), lags=50) != compress(recorded(2), lags=50)
    with pytest.raises(TypeError, match="unhashable"):
        hash(compress(recorded(), lags=50))


def test_sum_of_a_list_joins():
    parts = [compress(recorded(seed), lags=50) for seed in range(3)]
    assert sum(parts) == parts[0] + parts[1] + parts[2]


def test_saved_and_loaded_unchanged(tmp_path):
    joined = compress(
        recorded(units={"u": "deg", "y": "V"}, band=(0.5, 20.0)), lags=50, knots=(0, 5)
    )
    joined = joined + compress(recorded(2, units={"u": "deg", "y": "V"}), lags=50, knots=(0, 5))
    hmpim.save(joined, tmp_path / "s.h5")
    back = hmpim.load(tmp_path / "s.h5")
    assert back == joined
    assert isinstance(back, hmpim.Statistics)


def test_a_damaged_file_is_refused(tmp_path):
    path = tmp_path / "s.h5"
    hmpim.save(compress(recorded(), lags=50), path)
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(hmpim.HmpimError, match=r"s\.h5"):
        hmpim.load(path)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"lags": 60}, "lags is 50 here and 60 there"),
        ({"knots": (0, 3)}, "1 knots here and 2 there"),
        ({"bias": "common"}, "bias is 'own' here and 'common' there"),
    ],
)
def test_runs_of_different_kinds_are_not_joined(change, match):
    with pytest.raises(HmpimError, match=match):
        compress(recorded(), lags=50) + compress(recorded(2), **{"lags": 50, **change})


def test_what_cannot_be_compressed_is_said():
    two = Record.from_arrays({"a": np.arange(9.0), "b": np.ones(9)}, {"y": np.ones(9)}, fs=1.0)
    with pytest.raises(HmpimError, match=r"2 inputs \('a', 'b'\).*channels="):
        compress(two)
    assert compress(two, channels=("a", "y"), lags=4).names == ("a", "y")
    with pytest.raises(HmpimError, match="no input 'c'; it has 'a', 'b'"):
        compress(two, channels=("c", "y"))
    with pytest.raises(HmpimError, match="lags = 0 is not a window"):
        compress(recorded(), lags=0)
    with pytest.raises(HmpimError, match="do not increase"):
        compress(recorded(), knots=(3.0, 1.0))
    with pytest.raises(HmpimError, match="belongs to one run"):
        compress(recorded(), knots=(0.0, 1.0), bias="common")
    time = np.delete(np.arange(600) / 100, slice(200, 260))
    gap = Record.from_arrays({"u": np.sin(time)}, {"y": np.sin(time)}, time=time)
    with pytest.raises(HmpimError, match="samples missing; compress the stretches"):
        compress(gap)


def test_what_does_not_continue_a_run_is_refused():
    statistics = compress(recorded(), lags=50)
    with pytest.raises(HmpimError, match="u has 3 samples and y 2"):
        statistics.update(np.zeros(3), np.zeros(2))
    with pytest.raises(HmpimError, match="y holds nan at place 1"):
        statistics.update(np.zeros(2), np.array([0.0, np.nan]))
    with pytest.raises(HmpimError, match="2 runs were joined"):
        (statistics + statistics).update(np.zeros(3), np.zeros(3))
    assert statistics.update([], []).samples == 1500
