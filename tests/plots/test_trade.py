"""Pictures of the trade and of the condition number."""

import numpy as np
import pytest

from hmpim.optimal import Accuracy, RoughModel, TradePoint, gentlest
from hmpim.plots.condition import input_condition_plot
from hmpim.plots.trade import trade_plot
from hmpim.stimulus import Limits
from hmpim.stimulus.axes import InputCondition


@pytest.fixture(scope="module")
def found():
    return gentlest(
        accuracy=Accuracy(),
        model=RoughModel(natural_frequency=5, damping_ratio=0.5),
        noise_std=0.1,
        limits=Limits(position=10, unit="deg"),
        fs=100.0,
        duration=3.0,
        families=("multisine",),
    )


def test_the_wanted_point_and_what_is_beyond_the_limits(found):
    points = (
        TradePoint(factor=0.1, value=None),
        TradePoint(factor=1.0, value=found.value),
        TradePoint(factor=2.0, value=found.value / 2),
    )
    (axes,) = trade_plot(found, points).axes
    curve = axes.lines[0]
    assert list(curve.get_xdata()) == [1.0, 2.0]
    assert list(curve.get_ydata()) == [found.value, found.value / 2]
    assert "beyond the limits" in [t.get_text() for t in axes.get_legend().get_texts()]
    assert axes.get_xlabel() == "Errors allowed, in times those wanted (–)"


def test_what_is_not_told_apart_is_shaded():
    f = np.linspace(1.0, 10.0, 50)
    condition = np.where(f > 6.0, np.inf, 2.0)
    found = InputCondition(names=("a", "b"), frequency=f, condition=condition, bound=10.0)
    (axes,) = input_condition_plot(found).axes
    reach = axes.collections[0].get_datalim(axes.transData)
    assert 5.5 < reach.x0 < 6.5 < reach.x1
    assert [float(line.get_ydata()[0]) for line in axes.lines][-1] == 10.0
    assert np.all(np.isfinite(axes.lines[0].get_ydata()))
