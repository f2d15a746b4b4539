"""docs/added-phase.md: its code runs and prints what stands there."""

import re
from pathlib import Path

import pytest

TEXT = (Path(__file__).parents[2] / "docs" / "added-phase.md").read_text(encoding="utf-8")


def test_the_code_prints_what_stands_there(tmp_path, monkeypatch, capsys):
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    (shown,) = re.findall(r"<!-- output -->\n```\n(.*?)```", TEXT, re.DOTALL)
    exec(compile(code, "docs/added-phase.md", "exec"), {})
    found, stated = ([float(x) for x in re.findall(r"\d+\.\d", text)]
                     for text in (capsys.readouterr().out, shown))  # fmt: skip
    assert found == pytest.approx(stated, abs=0.15)  # the last digit may differ between machines
    assert (tmp_path / "added-phase.svg").is_file()
