"""docs/licences.md is what the installed packages say."""

import licences
import pytest


def test_the_page_is_what_is_installed():
    written = licences.PAGE.read_text(encoding="utf-8")
    assert written == licences.page(), "run: python benchmarks/licences.py"


@pytest.mark.parametrize(
    ("package", "words"),
    [("asammdf", "LGPL"), ("npTDMS", "LGPL"), ("pymavlink", "LGPL"), ("pyulog", "BSD")],
)
def test_a_licence_is_the_package_s_own(package, words):
    assert words in licences.licence_of(package)


def test_the_extras_under_the_lgpl_are_named():
    head = licences.page().partition("## ")[0]
    for extra in ("mdf", "tdms", "ardupilot"):
        assert f"(extra `{extra}`)" in head


def test_no_licence_is_strong_copyleft():
    """A GPL package would bind who uses it; the LGPL ones are extras."""
    for extra, rows in licences.tables().items():
        for name, licence in rows:
            assert "GPL" not in licence.replace("LGPL", ""), (extra, name, licence)
            assert extra or "LGPL" not in licence, name
