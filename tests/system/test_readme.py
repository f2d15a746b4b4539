"""All that the README shows is executed here; the table of contents is pinned."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import hmpim
from docs_following import snippet

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_lines_of_python_run(capsys):
    code = snippet("README.md", "import hmpim")
    exec(compile(code, "README.md", "exec"), {})
    assert re.fullmatch(r"0\.1\d+ ± 0\.0000\d+ s\n", capsys.readouterr().out)


def test_it_is_five_lines():
    code = snippet("README.md", "import hmpim")
    body = [line for line in code.splitlines() if line and not line.startswith("import")]
    assert len(body) == 5


def test_the_identify_command_runs(tmp_path):
    command = snippet("README.md", "hmpim identify")
    stimulus = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20), duration=10), fs=200)
    sensor = hmpim.Sensor(delay=0.05, time_constant=0.05, noise_std=0.02)
    record = hmpim.run(sensor, stimulus, rng=1)
    from hmpim.formats import write_csv

    write_csv(record, tmp_path / "test.csv")
    program = Path(sys.executable).with_name("hmpim")
    done = subprocess.run(
        [str(program), *command.split()[1:]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "COLUMNS": "160"},
    )
    assert done.returncode == 0, done.stderr
    assert "Time constant" in done.stdout
    assert (tmp_path / "report.html").stat().st_size > 50_000
    assert (tmp_path / "result.json").is_file()


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\(([^)#]+)\)", README))))
def test_every_link_leads_somewhere(target):
    assert target.startswith("https://") or (ROOT / target).is_file()


def test_the_public_names():
    assert sorted(hmpim.__all__) == [
        "Channel",
        "Chirp",
        "Estimate",
        "FunctionRig",
        "HmpimError",
        "Identification",
        "Limits",
        "LiveEstimator",
        "Model",
        "Ramp",
        "Record",
        "Sensor",
        "Sine",
        "Statistics",
        "Step",
        "Stimulus",
        "SumOfSines",
        "Sweep",
        "Until",
        "batch",
        "compress",
        "design",
        "design_axes",
        "draw_models",
        "export",
        "frequency_response",
        "gentlest",
        "identify",
        "identify_levels",
        "identify_repeats",
        "load",
        "paper_analysis",
        "predict",
        "read",
        "report",
        "run",
        "save",
        "simulate",
        "to_model",
        "validate",
    ]
    assert all(hasattr(hmpim, name) for name in hmpim.__all__)
    assert callable(hmpim.identify)
    assert callable(hmpim.report)


@pytest.mark.parametrize("document", sorted((ROOT / "docs").rglob("*.md")), ids=lambda p: p.name)
def test_links_between_documents_lead_somewhere(document):
    for target in re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8")):
        place, _, chapter = target.partition("#")
        page = document.parent / place if place else document
        assert place.startswith("https://") or page.exists(), target
        if chapter:
            assert chapter in anchors(page.read_text(encoding="utf-8")), target


def anchors(text):
    """What the site and GitHub make of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
