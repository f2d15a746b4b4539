"""What several rooms' tests share: the measured records, the paper's system, closed forms."""

import os
from pathlib import Path

import numpy as np
import pytest

from tests_support import field_chirp, second_order_lag

DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture
def measured():
    """Folder of measured records; the test is skipped where it is absent."""
    if not DATA.is_dir():
        pytest.skip(
            f"measured records are not here: no folder ../shared/data beside {DATA.parents[1].name}"
        )
    return DATA


@pytest.fixture
def seeds() -> int:
    """How many seeds a study takes; HMPIM_SEEDS makes it larger or smaller."""
    return int(os.environ.get("HMPIM_SEEDS", "200"))


@pytest.fixture(scope="session")
def field_record():
    """Time, input and noise-free output of the record every tool is compared on.

    Second order 10 Hz, ζ 0.4, delay 150 ms, bias 0.6, 10 s at 200 Hz.
    """
    time = np.arange(2000) / 200.0
    y = second_order_lag(time, field_chirp, delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
    return time, field_chirp(time), y + 0.6
