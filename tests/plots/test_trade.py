"""Pictures of the trade and of the condition number."""

import numpy as np
import pytest

from hmpim.optimal import Accuracy, RoughModel, TradePoint, gentlest
from hmpim.plots import Curve, Rule, Span
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
    (panel,) = trade_plot(found, points).panels
    (curve,) = panel.of(Curve)
    assert list(curve.x) == [1.0, 2.0]
    assert list(curve.y) == [found.value, found.value / 2]
    assert [span.label for span in panel.of(Span)] == ["beyond the limits"]
    assert panel.x.label == "Errors allowed, relative to those wanted"


def test_what_is_not_told_apart_is_shaded():
    f = np.linspace(1.0, 10.0, 50)
    condition = np.where(f > 6.0, np.inf, 2.0)
    found = InputCondition(names=("a", "b"), frequency=f, condition=condition, bound=10.0)
    (panel,) = input_condition_plot(found).panels
    (span,) = panel.of(Span)
    assert 5.5 < span.low < 6.5 < span.high
    assert [rule.at for rule in panel.of(Rule)] == [10.0]
    assert np.all(np.isfinite(panel.of(Curve)[0].y))
