"""``hmpim report``: a saved result becomes a page, a PDF, a sheet to sign."""

import sys

import pytest

import hmpim
from hmpim.cli.main import app
from hmpim.identify import (
    Estimate,
    FrequencyResponse,
    Identification,
    PairIdentification,
    PaperEstimates,
    Parameters,
    RecordSummary,
)


def run(*words: object) -> object:
    return app([str(w) for w in words], standalone_mode=False)


@pytest.fixture
def saved(tmp_path):
    import numpy as np

    f = np.geomspace(0.1, 10.0, 20)
    one = Estimate(value=1.0, std=0.01, ci95=(0.98, 1.02))
    pair = PairIdentification(
        input="u", output="y", structure="static", intersample="zoh", fit_percent=99.0,
        parameters=Parameters(scale_factor=one), paper=PaperEstimates(), candidates=(),
        frequency_response=FrequencyResponse(frequency=f, response=1 + 0j * f, std=0.1 + 0 * f),
        numerator=(1.0,), denominator=(1.0,), verdict="ok", warnings=(),
    )  # fmt: skip
    record = RecordSummary(fs=200.0, samples=2000, sha256="ab")
    hmpim.save(Identification(record=record, pairs=(pair,)), tmp_path / "r.json")
    return tmp_path / "r.json"


def test_page_sheet_and_pdf_say_who_tested_what(saved, tmp_path):
    who = ("--under-test", "Gyro 12", "--operator", "M. Ohm", "--note", "Warm.", "--title", "T")
    run("report", saved, "-o", tmp_path / "r.html", "--sign", tmp_path / "s.html", *who)
    for name in ("r.html", "s.html"):
        text = (tmp_path / name).read_text("utf-8")
        assert all(word in text for word in ("Gyro 12", "M. Ohm", "Warm.", "<h1>T</h1>"))
        assert "<svg" in text
    run("report", saved, "-o", tmp_path / "r.pdf", *who)
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF")


def refused(capsys, *words):
    assert run("report", *words) == 2
    return capsys.readouterr().err


def test_without_typst_a_pdf_is_refused_and_the_extra_named(saved, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "typst", None)
    assert "hmpim[pdf]" in refused(capsys, saved, "-o", tmp_path / "r.pdf")
    assert not (tmp_path / "r.pdf").exists()


def test_what_cannot_be_reported_is_refused(saved, tmp_path, capsys):
    assert "nothing to write" in refused(capsys, saved)
    assert ".docx" in refused(capsys, saved, "--sign", tmp_path / "s.docx")
