"""What may be wished for, and what is refused."""

import math

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.model import Model
from hmpim.optimal import Accuracy, ModelRange, RoughModel, Wish
from hmpim.stimulus import Limits

FIG_17 = RoughModel(delay=0.15, natural_frequency=10.0, damping_ratio=0.4)


def wish(**more):
    usual = {
        "accuracy": Accuracy(),
        "model": FIG_17,
        "model_range": ModelRange(),
        "noise_std": 0.1,
        "limits": Limits(position=10),
        "fs": 200.0,
        "gentle": "travel",
        "duration": 10.0,
    }
    return Wish(**{**usual, **more})


def test_half_widths_become_standard_deviations():
    wanted = Accuracy(delay=0.0196, natural_frequency=0.02, scale_factor=0.1, damping_ratio=None)
    rough = RoughModel(natural_frequency=5.0, damping_ratio=0.4, scale_factor=-3.0)
    assert wanted.std(rough) * 1.96 == pytest.approx([0.0196, 0.1, math.inf, 0.3], rel=1e-4)
    assert wanted.times(2.0).std(rough)[:2] == pytest.approx(2 * wanted.std(rough)[:2])


def test_the_slowest_time_constant():
    for zeta in (0.2, 0.999999, 1.7):
        rough = RoughModel(natural_frequency=3.0, damping_ratio=zeta)
        poles = np.roots([1.0, 2 * zeta * rough.omega, rough.omega**2])
        assert rough.settling == pytest.approx(-1.0 / poles.real.max(), rel=1e-3)


def test_an_identified_model_is_taken_over():
    omega = 2 * np.pi * 7.0
    denominator = (1.0, 2 * 0.3 * omega, omega**2)
    rough = RoughModel.of(Model(delay=0.1, scale_factor=-2.0, denominator=denominator))
    assert rough.natural_frequency == pytest.approx(7.0)
    assert rough.damping_ratio == pytest.approx(0.3)
    assert (rough.delay, rough.scale_factor) == (0.1, -2.0)
    with pytest.raises(ArgumentError, match="a model of order 1 cannot"):
        RoughModel.of(Model(delay=0.1, scale_factor=1.0, denominator=(1.0, 1.0)))


def test_a_range_holds_its_ends_and_every_combination():
    over = ModelRange(natural_frequency=(7, 14), damping_ratio=(0.2, 0.8), delay=(0, 0.2))
    models = over.models(FIG_17)
    assert len(models) == 5 * 3 * 2
    assert {m.natural_frequency for m in models} >= {7.0, 14.0}
    assert {m.delay for m in models} == {0.0, 0.2}
    assert len(over.models(FIG_17, finer=3)) == 13 * 7 * 2


def test_the_tail_holds_the_slowest_response():
    slow = wish(model_range=ModelRange(delay=(0.1, 0.4), damping_ratio=(0.1, 0.5)))
    settling = 1.0 / (2 * np.pi * 10.0 * 0.1)
    assert slow.tail == pytest.approx(0.4 + 4.6 * settling)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Accuracy(delay=0.0), "accuracy of delay = 0.0 must be"),
        (lambda: Accuracy(None, None, None, None), "takes 1 positional"),
        (lambda: RoughModel(natural_frequency=math.nan, damping_ratio=0.4), "nan Hz must be"),
        (lambda: RoughModel(delay=-1, natural_frequency=1, damping_ratio=1), "delay = -1 s"),
        (lambda: RoughModel(natural_frequency=1, damping_ratio=1, scale_factor=0), "scale_factor"),
        (lambda: ModelRange(natural_frequency=(14, 7)), r"\(14, 7\) does not rise"),
        (lambda: ModelRange(damping_ratio=(0, 1)), "does not rise from a positive"),
        (
            lambda: wish(model_range=ModelRange(natural_frequency=(12, 14))),
            "natural_frequency = 10 is outside its range, 12 to 14",
        ),
        (
            lambda: wish(model_range=ModelRange(damping_ratio=(0.1, 0.2))),
            "damping_ratio = 0.4 is outside its range",
        ),
        (lambda: wish(noise_std=0.0), "noise_std = 0.0 must be"),
        (lambda: wish(gentle="kind"), "gentle = 'kind' is not known"),
        (lambda: wish(gentle="duration", limits=Limits()), "no limit is finite"),
        (lambda: wish(fs=30.0), "sample at 34 Hz or faster"),
        (
            lambda: Accuracy(
                delay=None, natural_frequency=None, scale_factor=None, damping_ratio=None
            ),
            "no accuracy is given",
        ),
    ],
)
def test_refusals(make, message):
    with pytest.raises((ArgumentError, TypeError), match=message):
        make()
