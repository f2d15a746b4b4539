"""docs/software.md: its rig files are read, its protocol and options are those of the code."""

import dataclasses
import re
import tomllib
from pathlib import Path

from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.software import FmuRig, ProcessRig
from hmpim.rigs.software.process import _GREETING

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "software.md").read_text(encoding="utf-8")


def test_rig_files_are_taken():
    rigs = [
        find_rig("", description=describe(tomllib.loads(text))).rig
        for text in re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)
    ]
    fmu, tracker = rigs
    assert (fmu.interface, fmu.start) == ("exchange", {"T": 0.08})
    assert (tracker.camera.dropped, tracker.scene.noise_std) == (0.05, 3.0)


def test_the_protocol_is_that_of_the_code():
    assert f"> {_GREETING} rate=" in TEXT
    defaults = {f.name: f.default for f in dataclasses.fields(ProcessRig)}
    assert f"reported after {defaults['answer']:g} s" in TEXT
    assert f"for the greeting, {defaults['startup']:g} s" in TEXT
    (tolerance,) = (f.default for f in dataclasses.fields(FmuRig) if f.name == "tolerance")
    assert tolerance == 1e-8


def test_its_tables_are_filled_and_its_files_there():
    for name in ("software", "tracker", "seeker"):
        part = TEXT.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end of {name} -->")[0]
        assert part.count("\n|") >= 3, name
    for path in re.findall(r"(?:examples|benchmarks|tests)/[\w/]+\.\w+", TEXT):
        assert (ROOT / path).is_file(), path


def test_the_seeker_found_its_quarter_turn():
    part = TEXT.partition("<!-- seeker -->\n")[2].partition("<!-- end of seeker -->")[0]
    rows = [re.findall(r"([\d.]+)(?: ± [\d.e-]+)?(?: \(doubtful\))? Hz", line)
            for line in part.splitlines()[2:]]  # fmt: skip
    assert rows
    for steps, closed, fitted, behind in rows:
        assert abs(float(steps) / float(closed) - 1) < 0.05
        assert abs(float(fitted) / float(behind) - 1) < 0.05
