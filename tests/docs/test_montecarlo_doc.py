"""docs/montecarlo.md: its command runs and writes what the page says."""

import pytest

from docs_following import execute, snippet
from tests_support import in_studies


@pytest.mark.parametrize("draws", ["2", *in_studies("100")])
def test_the_command_runs(draws, tmp_path, monkeypatch):
    """In `make test` with fewer draws, in this process."""
    monkeypatch.chdir(tmp_path)
    command = snippet("montecarlo.md", "hmpim montecarlo field")
    assert "--draws 100" in command
    more = ("--workers", "0") if draws == "2" else ()
    execute(command.replace("--draws 100", f"--draws {draws}"), *more)
    assert (tmp_path / "out/field/study.html").is_file()
    assert (tmp_path / "field.json").is_file()
