"""Records of one stimulus, parameters alone: quicker, and the same."""

import numpy as np
import pytest

import hmpim
from hmpim.batch import Request, alike
from hmpim.batch.rows import PARAMETERS
from hmpim.batch.run import Cluster

FS, SAMPLES, UNITS = 100.0, 300, 12


def write_fleet(path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    time = np.arange(SAMPLES) / FS
    u = np.sin(2 * np.pi * (0.3 * time + 19.7 / 6 * time**2))
    rng = np.random.default_rng(5)
    outputs = []
    for k in range(UNITS):
        omega = 2 * np.pi * 7 * (1 + 0.03 * rng.standard_normal())
        model = hmpim.Model(
            delay=0.02, scale_factor=1 + 0.01 * k, denominator=(omega**-2, 1 / omega, 1.0)
        )
        y = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
        outputs.append(y + 0.005 * rng.standard_normal(SAMPLES))
    outputs[9] = np.minimum(outputs[9], 0.8)  # clipped: not as the others
    outputs[10][5] = np.nan
    cells = {"u": [u.tolist()] * UNITS, "y": [y.tolist() for y in outputs]}
    parquet.write_table(pa.table(cells), path)


def done_both_ways(path, folder):
    """Tables of the parameters alone, done together, and of everything, done one by one."""
    return [
        hmpim.batch(
            path,
            out=folder / keep,
            fs=FS,
            request=Request(keep=keep),
            cluster=Cluster(workers=0),
        )
        .to_pandas()
        .set_index("record")
        .sort_index()
        for keep in ("parameters", "results")
    ]


def test_one_stimulus_is_shared(tmp_path, monkeypatch):
    path = tmp_path / "fleet.parquet"
    write_fleet(path)
    monkeypatch.setattr(alike, "_LEARNT_FROM", 6)
    monkeypatch.setattr(alike, "_WORTH", UNITS - 2)
    monkeypatch.setattr(alike, "_FLEETS", {})
    together = []
    fit = alike.fit_fleet

    def counted(fleet, outputs, **options):
        found = fit(fleet, outputs, **options)
        together.append(found.sound.tolist())
        return found

    monkeypatch.setattr(alike, "fit_fleet", counted)
    quick, whole = done_both_ways(path, tmp_path)
    assert len(together) == 1
    assert len(together[0]) == UNITS - 7  # all but those learnt from and the one with a gap
    assert together[0].count(False) >= 1  # the clipped one, at least
    assert quick.index.tolist() == whole.index.tolist()
    for name in ("delay", "natural_frequency", "scale_factor", "saturation_high"):
        error = whole[f"{name}_std"]
        error = error.fillna(error.median())  # an interval that is not symmetric has no deviation
        off = (quick[name] - whole[name]).abs()
        assert (quick[name].isna() == whole[name].isna()).all(), name
        assert (off.dropna() <= 0.01 * error[off.notna()] + 1e-12).all(), name
    assert quick["verdict"].tolist() == pytest.approx(whole["verdict"].tolist())
    assert quick["sha256"].tolist() == whole["sha256"].tolist()
    assert [list(w) for w in quick["warnings"]] == [list(w) for w in whole["warnings"]]
    assert quick["result"].isna().all()


KINDS = {
    "static": lambda omega: (1.0,),
    "first_order": lambda omega: (1 / omega, 1.0),
    "second_order": lambda omega: (omega**-2, 0.9 / omega, 1.0),
}


def write_many(path, kind: str, count: int) -> None:
    """Units of one kind, and among them those of which something else is to be said."""
    import pyarrow as pa
    from pyarrow import parquet

    time = np.arange(600) / FS
    u = np.sin(2 * np.pi * (0.3 * time + 19.7 / 12 * time**2))
    rng = np.random.default_rng(8)
    outputs = []
    for _ in range(count):
        omega = 2 * np.pi * 6 * (1 + 0.03 * rng.standard_normal())
        delay = 0.03 * (1 + 0.03 * rng.standard_normal())
        model = hmpim.Model(delay=delay, scale_factor=2.0, denominator=KINDS[kind](omega), bias=0.3)
        y = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
        outputs.append(y + 0.1 * rng.standard_normal(600))
    outputs[20] = np.minimum(outputs[20], 1.5)
    outputs[25] = outputs[25] + np.linspace(0, 3, 600)
    outputs[30] = outputs[30] + 0.2 * outputs[30] ** 2
    outputs[35] = np.round(outputs[35], 0)
    outputs[40][100:110] = np.nan
    outputs[45] = rng.standard_normal(600)
    cells = {"u": [u.tolist()] * count, "y": [y.tolist() for y in outputs]}
    parquet.write_table(pa.table(cells), path)


@pytest.mark.study
@pytest.mark.parametrize("kind", KINDS)
def test_every_record_says_what_it_says_alone(tmp_path, monkeypatch, kind):
    """Values to a hundredth of an interval, intervals to a twentieth, all verdicts and findings."""
    monkeypatch.setattr(alike, "_FLEETS", {})
    path = tmp_path / "many.parquet"
    write_many(path, kind, 70)
    quick, whole = done_both_ways(path, tmp_path)
    assert (alike._FLEETS.popitem()[1] is not None) == (kind == "second_order")
    assert [list(w) for w in quick["warnings"]] == [list(w) for w in whole["warnings"]]
    for name in ("verdict", "structure", "intersample", "sha256", "fs", "samples"):
        assert quick[name].tolist() == whole[name].tolist(), name
    for name in PARAMETERS:
        if name == "delay_correlation":
            continue
        assert (quick[name].isna() == whole[name].isna()).all(), name
        half = (whole[f"{name}_high"] - whole[f"{name}_low"]) / 2
        for end, share in (("", 0.01), ("_low", 0.05), ("_high", 0.05)):
            off = (quick[name + end] - whole[name + end]).abs() / half
            assert not (off > share).any(), (name + end, off.max())
