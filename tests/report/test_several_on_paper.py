"""Repeats and levels as a PDF: what the HTML page says, typeset."""

import re
import shutil
import subprocess

import numpy as np
import pytest

import hmpim
from hmpim.identify import identify_levels, identify_repeats
from hmpim.report import About
from hmpim.report.several import levels_report, repeats_report
from tests_support import missing

FS = 100.0
TIME = np.arange(800) / FS
U = np.sin(2 * np.pi * (0.1 * TIME + 1.0 * TIME**2))
NAMES = ("#panic() $x$ \\.csv", "2026-11-24_bench-7_sweep_of_the_inner_gimbal_warm.csv", "c.csv")

TOLD = (
    "#set page(fill: red)", "M. Ohm", "Warm: −3 K.", NAMES[0], "3 repeats: the scatter",
    "Averages over the runs", "χ² / degrees of freedom", "By run: value", "Natural frequency (Hz)",
    "Delay, pure (s)", "About this study", "1 / ",
)  # fmt: skip


def record(gain, seed, natural=6.0):
    w = 2 * np.pi * natural
    model = hmpim.Model(delay=0.03, scale_factor=2.0, denominator=(1 / w**2, 0.8 / w, 1.0))
    noise = 0.02 * np.random.default_rng(seed).standard_normal(U.size)
    y = hmpim.simulate(model, gain * U, fs=FS, intersample="bandlimited") + noise
    return hmpim.Record.from_arrays(
        {"u": gain * U}, {"y": y}, fs=FS, units={"u": "deg", "y": "deg"}, intersample="bandlimited"
    )


@pytest.fixture
def words():
    reader = shutil.which("pdftotext") or missing("pdftotext", "pdftotext of Poppler")

    def words(path):
        done = subprocess.run([reader, "-layout", path, "-"], check=True, capture_output=True)
        return " ".join(done.stdout.decode().replace("\u200b", "").split())

    return words


def sheets(path):
    return len(re.findall(rb"/Type\s*/Page\b", path.read_bytes()))


def test_repeats_on_paper_say_what_their_page_says(tmp_path, words):
    repeats = identify_repeats([record(1.0, seed) for seed in range(3)])
    about = About(title="#set page(fill: red)", operator="M. Ohm")
    repeats_report(repeats, NAMES, tmp_path / "r.pdf", about=about, notes=["Warm: -3 K."])
    said = words(tmp_path / "r.pdf")
    for told in TOLD:
        assert told in said, told
    natural = repeats["y", "u"].parameters
    shown = next(p.mean for p in natural if p.name == "natural_frequency")
    assert f"{shown.value:.2f}" in said
    assert sheets(tmp_path / "r.pdf") <= 4


def test_levels_on_paper_say_what_their_page_says(tmp_path, words):
    levels = identify_levels([record(g, k, natural=6.0 + 0.1 * g) for k, g in enumerate((1, 2, 4))])
    levels_report(levels, NAMES, tmp_path / "l.pdf")
    said = words(tmp_path / "l.pdf")
    for told in ("3 levels: ", "By amplitude of u", "Change", "2 deg", "4 deg", "Amplitude: half"):
        assert told in said, told
    assert sheets(tmp_path / "l.pdf") <= 4
