"""The accuracy study in a reduced size: the same code as `make accuracy`."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def section(text, title):
    """What stands between a heading and the next one."""
    _, found, rest = text.partition(f"\n## {title}\n")
    assert found, f"no section {title!r}"
    return rest.partition("\n## ")[0]


@pytest.mark.study
def test_a_reduced_study_keeps_its_promises(tmp_path):
    page = tmp_path / "accuracy.md"
    done = subprocess.run(
        [sys.executable, "benchmarks/accuracy.py", "--share", "0.03", "--out", str(page)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    text = page.read_text(encoding="utf-8")
    assert "**hmpim**" in text
    check_bound(section(text, "At the Cramér-Rao bound"))
    check_random(section(text, "Random systems, no hints"))
    check_effects(section(text, "Sensor effects"))


def check_bound(text):
    rows = re.findall(r"^\| `(\w+)` \|.*\| (\d\.\d{3}) \| ([\d.]+) % \|$", text, re.MULTILINE)
    assert [name for name, *_ in rows] == [
        "delay",
        "scale_factor",
        "bias",
        "natural_frequency",
        "damping_ratio",
    ]
    for name, ratio, inside in rows:
        # Sixty seeds: the r.m.s. itself scatters by a tenth, the share by three in a hundred.
        assert 0.6 < float(ratio) < 1.4, name
        assert float(inside) > 82.0, name


def check_random(text):
    systems, near = re.search(r"Of (\d+) random systems (\d+)", text).groups()
    assert int(near) >= int(systems) - 1
    assert re.search(r"\b0 carry the verdict `ok`", text)


def check_effects(text):
    """An effect that puts the intervals off the truth must not pass for `ok`."""
    rows = [line.split(" | ") for line in text.splitlines() if "σ" in line and "|" in line]
    assert len(rows) > 8
    for effect, *cells, _, confident in rows:
        shares = [float(cell.rpartition(", ")[2].rstrip(" %")) for cell in cells]
        assert len(shares) == 5
        if min(shares) < 50.0:
            assert float(confident.rstrip(" %|")) == 0.0, effect


def test_what_is_checked_can_fail():
    """The checks themselves, on pages that break each promise by a little."""
    row = "| `{}` | 0.1 ms | 0.1 ms | {} | 95.0 % |"
    names = ("delay", "scale_factor", "bias", "natural_frequency", "damping_ratio")
    good = "\n".join(row.format(name, "1.010") for name in names)
    check_bound(good)
    for bad in (good.replace("1.010", "1.410"), good.replace("95.0", "75.0"), good[:200]):
        with pytest.raises(AssertionError):
            check_bound(bad)
    check_random("Of 15 random systems 14. Of the other 1, 0 carry the verdict `ok`.")
    for bad in (
        "Of 15 random systems 13. Of the other 2, 0 carry the verdict `ok`.",
        "Of 15 random systems 15. Of the other 10 carry the verdict `ok`.",
    ):
        with pytest.raises(AssertionError):
            check_random(bad)
    line = "| clipped | +0.1 σ, {} %" + " | +0.1 σ, 90 %" * 4 + " | 0.05 | {} % |"
    fine = [line.format(90, 100)] * 8
    check_effects("\n".join([*fine, line.format(0, 0)]))
    with pytest.raises(AssertionError):
        check_effects("\n".join([*fine, line.format(0, 10)]))
