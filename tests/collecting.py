"""What makes collection quick, as every process of a run does it, and what it looks for."""

import gc

import pytest
from _pytest.doctest import DoctestModule

ABSENT = pytest.StashKey[list[str]]()
"""Tests and the fixtures that they ask for in vain."""


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Leave out modules without an example: most of the tests', and a third of the package's.

    What they import stays unimported until a test needs it.
    """
    found = yield
    if file_path.suffix == ".py" and ">>>" not in file_path.read_text(encoding="utf-8"):
        return [one for one in found if not isinstance(one, DoctestModule)]
    return found


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Note who asks for a fixture that is not there, studies among them, before any is left out."""
    config.stash[ABSENT] = [
        f"{item.nodeid}: {name}"
        for item in items
        if isinstance(item, pytest.Function)
        for name in item.fixturenames
        if name != "request" and name not in item._fixtureinfo.name2fixturedefs
    ]


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """Keep what was collected out of every later search for garbage."""
    gc.freeze()
    gc.enable()
