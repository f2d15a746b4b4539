"""What makes collection quick: every process of a run does it."""

import gc

import pytest
from _pytest.doctest import DoctestModule


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path):
    """Leave out modules without an example: most of the tests', and a third of the package's.

    What they import stays unimported until a test needs it.
    """
    found = yield
    if file_path.suffix == ".py" and ">>>" not in file_path.read_text(encoding="utf-8"):
        return [one for one in found if not isinstance(one, DoctestModule)]
    return found


@pytest.hookimpl(trylast=True)
def pytest_collection_finish():
    """Keep what was collected out of every later search for garbage."""
    gc.freeze()
    gc.enable()
