"""What statistics say of one more pole."""

import numpy as np

import hmpim
from hmpim.identify.fitting.least_squares import UNSEEN
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.statistics import misfit
from hmpim.identify.statistics.choose import choose
from hmpim.identify.statistics.fit import as_fitted
from hmpim.model import STRUCTURES


def test_a_pole_that_the_model_imitates_has_no_endless_square(monkeypatch):
    t = np.arange(1000) / 200.0
    u = np.sin(2 * np.pi * (0.2 * t + 4 * t**2))
    model = hmpim.Model(delay=0.02, scale_factor=2.0, bias=0.1, denominator=(0.01, 1.0))
    y = np.asarray(hmpim.simulate(model, u, fs=200.0, intersample="bandlimited"))
    y = y + 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0, intersample="bandlimited")
    statistics = hmpim.compress(record)
    _, joint = choose(statistics, intersample=None, structures=tuple(STRUCTURES))
    fitted = as_fitted(joint.best.fit)

    def imitated(problem, fit):
        (row,) = part_of(problem, fit.structure, fit.theta).rows
        return 3.0 * row

    monkeypatch.setattr(misfit, "response_to_square", imitated)
    hidden = misfit.hidden_pole_of(fitted)
    # Of the row's power rounding alone is left; the scale factor's deviation is that of all of it.
    scale = float(np.sqrt(fitted.variance / fitted.moments.gram[-1, -1])) / 3.0
    assert 0.0 < hidden.std <= 2.0 * scale / np.sqrt(UNSEEN)
