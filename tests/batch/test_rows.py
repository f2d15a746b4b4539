"""What is kept of a record as JSON."""

import json

import numpy as np
import pytest

import hmpim
from hmpim.batch.rows import _json


def identified():
    u = np.sin(np.arange(600) ** 2 / 2000)
    noise = 0.01 * np.random.default_rng(0).standard_normal(600)
    return hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": 2 * u + noise}, fs=100.0))


def test_json_holds_every_number_to_the_last_digit():
    result = identified()
    assert json.loads(_json(result)) == json.loads(json.dumps(result.to_dict(), allow_nan=False))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_number_that_json_cannot_hold_is_refused_not_left_out(value):
    result = identified()
    result.pairs[0].frequency_response.std[3] = value
    with pytest.raises(ValueError, match="NaN or infinite"):
        _json(result)
