"""One result for all tests of reports: the paper's Fig. 17 sensor, identified for real."""

import numpy as np
import pytest

from hmpim.identify import Identification
from hmpim.identify.identify import identify
from hmpim.record import Record


def identified(field_record, *, input_name="u", output_name="y", unit="deg") -> Identification:
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(4).standard_normal(y.size)
    record = Record.from_arrays(
        {input_name: u},
        {output_name: noisy},
        fs=200.0,
        units={input_name: unit, output_name: unit},
        band=(0.1, 20.0),
    )
    return identify(record)


@pytest.fixture(scope="session")
def found(field_record):
    return identified(field_record)


@pytest.fixture(scope="session")
def hostile(field_record):
    """A result whose channels have the worst names that a file could hold."""
    return identified(
        field_record,
        input_name="<script>alert('u')</script>",
        output_name='"&\x00\x1b[31m $\\frac{ {{ 7*7 }} url(#x) </svg>',
    )
