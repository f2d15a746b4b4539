"""What campaigns ask for: the same plan gives the same record, whose answer is found once."""

from functools import cache

import pytest

from hmpim.campaign import run
from hmpim.identify import identify


@pytest.fixture(scope="session")
def answers():
    """`identify`, once for each record: a record is never changed, nor is what is found of it."""
    return cache(identify)


@pytest.fixture(scope="module", autouse=True)
def found_once(answers):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "identify", answers)
        yield
