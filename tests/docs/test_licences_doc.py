"""docs/licences.md is what the installed packages say."""

import importlib.util
from pathlib import Path

import licences
import pytest


def test_the_page_is_what_is_installed():
    written = licences.PAGE.read_text(encoding="utf-8")
    assert written == licences.page(), "run: python benchmarks/licences.py"


@pytest.mark.parametrize(
    ("package", "words"),
    [("asammdf", "LGPL"), ("npTDMS", "LGPL"), ("pyulog", "BSD")],
)
def test_a_licence_is_the_package_s_own(package, words):
    assert words in licences.licence_of(package)


def test_the_extras_under_the_lgpl_are_named():
    head = licences.page().partition("## ")[0]
    for extra in ("mdf", "tdms"):
        assert f"(extra `{extra}`)" in head


def test_no_licence_is_strong_copyleft():
    """A GPL package would bind who uses it; the LGPL ones are extras."""
    for extra, rows in licences.tables().items():
        for name, licence in rows:
            assert "GPL" not in licence.replace("LGPL", ""), (extra, name, licence)
            assert extra or "LGPL" not in licence, name


def test_the_reader_of_ardupilot_logs_that_is_under_the_gpl_is_a_tool_of_tests_alone():
    """What docs/decisions/0006 says of pymavlink is what its files say, and no extra brings it."""
    spec = importlib.util.find_spec("pymavlink.DFReader")
    assert spec is not None
    assert spec.origin is not None
    head = Path(spec.origin).read_text(encoding="utf-8")[:400]
    assert "GNU GPL version 3" in head
    assert "LGPL" in licences.licence_of("pymavlink")
    assert "pymavlink" not in {name for rows in licences.tables().values() for name, _ in rows}
