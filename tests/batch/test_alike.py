"""Records of one stimulus, done together: quicker, and the same."""

import json

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


def done(path, folder, keep, monkeypatch, *, worth):
    """The table of a batch, what records share learnt from so many on."""
    monkeypatch.setattr(alike, "_WORTH", worth)
    monkeypatch.setattr(alike, "_FLEETS", {})
    monkeypatch.setattr(alike, "_FIRST", {})
    table = hmpim.batch(
        path,
        out=folder / f"{keep}-{worth}",
        fs=FS,
        request=Request(keep=keep),
        cluster=Cluster(workers=0),
    )
    return table.to_pandas().set_index("record").sort_index()


NEVER = 10**9


def hold_responses_together(one, other, *, off):
    """Measured responses, by their own deviations; the paper's figures, to the last digit."""
    pair, alone = (json.loads(text)["pairs"][0] for text in (one, other))
    told, wanted = (p["frequency_response"] for p in (pair, alone))
    assert told["frequency"] == pytest.approx(wanted["frequency"])
    std = np.array(wanted["std"])
    apart = np.hypot(*(np.array(told[k]) - np.array(wanted[k]) for k in ("real", "imag"))) / std
    assert np.median(apart) < off / 5
    assert np.quantile(apart, 0.95) < off
    assert np.median(np.abs(np.array(told["std"]) / std - 1)) < off
    for name, own in alone["paper"].items():
        told_of = pair["paper"][name]
        assert told_of == own if own is None else told_of == pytest.approx(own, rel=1e-6), name
    for name, own in alone["bandwidths_from_response"].items():
        if own is not None:
            value = pair["bandwidths_from_response"][name]["value"]
            assert value == pytest.approx(own["value"], abs=off * own["std"]), name
    assert pair["nonlinearity"] == alone["nonlinearity"]
    assert pair["warnings"] == alone["warnings"]
    assert {(c["structure"], c["intersample"]) for c in pair["candidates"]} == {
        (c["structure"], c["intersample"]) for c in alone["candidates"]
    }
    covariance = np.array(alone["dynamics"]["covariance"])
    assert np.array(pair["dynamics"]["covariance"]) == pytest.approx(
        covariance, abs=1e-3 * np.abs(covariance).max()
    )


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """The records, and what is found of each alone."""
    folder = tmp_path_factory.mktemp("fleet")
    path = folder / "fleet.parquet"
    write_fleet(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(alike, "fit_fleet", lambda *_, **__: pytest.fail("not alone"))
        return path, done(path, folder, "results", patch, worth=NEVER)


@pytest.mark.parametrize("keep", ["parameters", "results"])
def test_one_stimulus_is_shared(fleet, tmp_path, monkeypatch, keep):
    path, alone = fleet
    monkeypatch.setattr(alike, "_LEARNT_FROM", 6)
    together = []
    fit = alike.fit_fleet

    def counted(fleet, outputs, **options):
        found = fit(fleet, outputs, **options)
        together.append(found.sound.tolist())
        return found

    monkeypatch.setattr(alike, "fit_fleet", counted)
    quick = done(path, tmp_path, keep, monkeypatch, worth=UNITS - 2)
    assert len(together) == 1
    assert len(together[0]) == UNITS - 7  # all but those learnt from and the one with a gap
    assert together[0].count(False) >= 1  # the clipped one, at least
    assert quick.index.tolist() == alone.index.tolist()
    for name in ("delay", "natural_frequency", "scale_factor", "saturation_high"):
        error = alone[f"{name}_std"]
        error = error.fillna(error.median())  # an interval that is not symmetric has no deviation
        off = (quick[name] - alone[name]).abs()
        assert (quick[name].isna() == alone[name].isna()).all(), name
        assert (off.dropna() <= 0.01 * error[off.notna()] + 1e-12).all(), name
    assert quick["verdict"].tolist() == pytest.approx(alone["verdict"].tolist())
    assert quick["sha256"].tolist() == alone["sha256"].tolist()
    assert [list(w) for w in quick["warnings"]] == [list(w) for w in alone["warnings"]]
    if keep == "parameters":
        assert quick["result"].isna().all()
        return
    for one, other in zip(quick["result"], alone["result"], strict=True):
        if other is not None:
            hold_responses_together(one, other, off=0.05)


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
@pytest.mark.parametrize("keep", ["parameters", "results"])
@pytest.mark.parametrize("kind", KINDS)
def test_every_record_says_what_it_says_alone(tmp_path, monkeypatch, kind, keep):
    """Values to a hundredth of an interval, intervals to a twentieth, all verdicts and findings."""
    path = tmp_path / "many.parquet"
    write_many(path, kind, 70)
    quick = done(path, tmp_path, keep, monkeypatch, worth=48)
    assert (alike._FLEETS.popitem()[1] is not None) == (kind == "second_order")
    whole = done(path, tmp_path, "results", monkeypatch, worth=NEVER)
    assert [list(w) for w in quick["warnings"]] == [list(w) for w in whole["warnings"]]
    for name in ("verdict", "structure", "intersample", "sha256", "fs", "samples"):
        assert quick[name].tolist() == whole[name].tolist(), name
    for name in PARAMETERS:
        if name == "delay_correlation" and keep == "parameters":
            continue
        assert (quick[name].isna() == whole[name].isna()).all(), name
        half = (whole[f"{name}_high"] - whole[f"{name}_low"]) / 2
        for end, share in (("", 0.01), ("_low", 0.05), ("_high", 0.05)):
            off = (quick[name + end] - whole[name + end]).abs() / half
            assert not (off > share).any(), (name + end, off.max())
    if keep == "results" and kind == "second_order":
        for one, other in zip(quick["result"], whole["result"], strict=True):
            hold_responses_together(one, other, off=0.2)
