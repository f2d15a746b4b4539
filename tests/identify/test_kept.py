"""What follows from the input alone is made once, and what is said of a record stays the same."""

import numpy as np

import hmpim
from hmpim.identify import kept as room
from hmpim.identify.kept import keeping, kept

FS, SAMPLES = 100.0, 500


FAULTS = {
    "": "intersample", "clipped": "saturation", "spikes": "spikes", "nonlinear": "nonlinear",
    "gaps": "gaps", "unrelated": "unrelated",
}  # fmt: skip
"""With what is said of each."""


def record(seed: int, *, last: float = 20.0, fault: str = "") -> hmpim.Record:
    time, rng = np.arange(SAMPLES) / FS, np.random.default_rng([7, seed])
    u = np.sin(2 * np.pi * (0.3 * time + (last - 0.3) / 10 * time**2))
    model = hmpim.Model(delay=0.02 + 0.011 * seed, scale_factor=2.0, denominator=(1e-3, 0.03, 1.0))
    y = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
    if fault == "nonlinear":
        y += 0.2 * y**2
    y += 0.05 * rng.standard_normal(SAMPLES)
    if fault == "clipped":
        y = np.minimum(y, 1.2)
    if fault == "spikes":
        y[[90, 180, 333]] += 8.0
    if fault == "unrelated":
        y = rng.standard_normal(SAMPLES)
    there = (time < 2.0) | (time >= 2.2) if fault == "gaps" else time >= 0.0
    return hmpim.Record.from_arrays({"u": u[there]}, {"y": y[there]}, time=time[there])


def test_a_result_is_the_same_to_the_last_digit():
    """Of records of one input with and without faults and of another in between."""
    records = [record(k % 4, fault=fault) for k, fault in enumerate(FAULTS)]
    records.insert(3, record(1, last=15.0))
    alone = [hmpim.identify(r).to_dict() for r in records]
    with keeping():
        beside = [hmpim.identify(r).to_dict() for r in records]
        assert room._KEPT.get()
    assert beside == alone
    assert room._KEPT.get() is None
    del alone[3]
    for told, code in zip(alone, FAULTS.values(), strict=True):
        assert code in [warning["code"] for warning in told["pairs"][0]["warnings"]]


def test_what_is_kept_is_bounded_and_found_by_the_samples():
    made = []

    @kept
    def doubled(u: np.ndarray, factor: float = 2.0) -> np.ndarray:
        made.append(factor)
        return factor * u

    u = np.arange(4.0)
    with keeping():
        first = doubled(u)
        assert doubled(u.copy()) is first
        assert not first.flags.writeable
        assert doubled(u, 3.0)[1] == 3.0
        u[1] = 5.0  # the array was changed: it is another input
        assert doubled(u)[1] == 10.0
        doubled(np.zeros(100_000))
        doubled(np.zeros(100_000))
        for k in range(100):
            doubled(u, float(k))
        assert len(room._KEPT.get()) == room._MOST
        with keeping():  # within another it belongs to that
            before = len(made)
            doubled(u, 99.0)
    assert len(made) == before
    doubled(u, 99.0)
    assert len(made) == before + 1


def test_a_long_array_is_found_again_where_it_stands():
    made = []

    @kept
    def ends(u: np.ndarray, whole: bool = False) -> np.ndarray:
        made.append(u.size)
        return u if whole else u[[0, -1]]

    u = np.arange(100_000.0)
    with keeping():
        first = ends(u)
        assert ends(u) is first
        ends(u.copy())
        assert len(made) == 2
        u[0] = 7.0  # it was changed: it is another
        assert ends(u)[0] == 7.0
        before = len(made)
        assert ends(u, whole=True) is ends(u, whole=True) is u  # no long result is kept
        assert len(made) == before + 2
        assert u.flags.writeable
