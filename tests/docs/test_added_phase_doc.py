"""docs/added-phase.md: its code runs and prints what stands there."""

import re

import pytest

from docs_following import snippet


def test_the_code_prints_what_stands_there(tmp_path, monkeypatch, capsys):
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    code, shown = snippet("added-phase.md", "import"), snippet("added-phase.md", "alone")
    exec(compile(code, "docs/added-phase.md", "exec"), {})
    found, stated = ([float(x) for x in re.findall(r"\d+\.\d", text)]
                     for text in (capsys.readouterr().out, shown))  # fmt: skip
    assert found == pytest.approx(stated, abs=0.15)  # the last digit may differ between machines
    assert (tmp_path / "added-phase.svg").is_file()
