"""Whether an output is unrelated to its input."""

import numpy as np

import hmpim


def test_an_output_that_stands_still_wherever_it_counts_is_unrelated():
    """It moves at the end alone, ahead of its input: a gain of 0 ± 0 was `ok`."""
    k = np.arange(400)
    u, y = (k > 390).astype(float), (k > 375).astype(float)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0, intersample="zoh")
    (pair,) = hmpim.identify(record)
    assert pair.verdict == "not_identifiable"
    assert pair.scale_factor is None
