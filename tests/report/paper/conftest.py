"""The paper's study is made once for all who look at it."""

import pytest

from hmpim.report.paper import make_study


@pytest.fixture(scope="session")
def whole_study():
    return make_study()
