"""What no stimulus can give: a bound that holds for all that are made, and refuses at once."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from hmpim.errors import LimitsError
from hmpim.optimal import Accuracy, ModelRange, RoughModel, Wish, gentlest
from hmpim.optimal.bound import least_share
from hmpim.optimal.candidate import try_out
from hmpim.optimal.multisine import best_multisine
from hmpim.stimulus import Limits, Sweep, rest_to_rest
from tests_support import in_studies

search_module = import_module("hmpim.optimal.gentlest")  # its function has the module's name
FIG_17 = RoughModel(delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
TIGHT = [
    {"position": 0.1},
    {"velocity": 4.0},
    {"acceleration": 200.0},
    {"position": 0.2, "velocity": 5.0, "acceleration": 300.0, "jerk": 2e4},
]


def wished(limits, **more):
    usual = {
        "accuracy": Accuracy(),
        "model": FIG_17,
        "model_range": ModelRange(),
        "noise_std": 0.1,
        "limits": Limits(**limits),
        "fs": 200.0,
        "gentle": "duration",
        "duration": 4.0,
    }
    return Wish(**{**usual, **more})


@pytest.mark.parametrize("limits", [TIGHT[0], TIGHT[3], *in_studies(TIGHT[1], TIGHT[2])])
def test_no_stimulus_that_is_made_takes_less(limits):
    wish = wished(limits)
    share = least_share(wish)
    assert share > 1.0
    cores = [Sweep(band=(0.5, top), duration=3.0, extinction=n) for top in (12, 18) for n in (0, 1)]
    for core in cores:
        waveform = rest_to_rest(core, limits=Limits(), fs=200.0)
        made = try_out(waveform, wish, family="sweep", total=4.0, shape=np.zeros(3))
        assert made.use > share
    best = best_multisine(wish, 4.0, starts=1, steps=12)
    assert share < best.use < 2.5 * share  # and it is not far below what can be made


@pytest.mark.parametrize("limits", TIGHT[::3])
def test_the_share_goes_with_noise_limits_and_length(limits):
    share = least_share(wished(limits))
    assert least_share(wished(limits, noise_std=0.2)) == pytest.approx(2.0 * share, rel=0.05)
    half = {name: value / 2.0 for name, value in limits.items()}
    assert least_share(wished(half)) == pytest.approx(2.0 * share, rel=0.05)
    longer = least_share(wished(limits, duration=16.0, noise_std=0.2))
    assert longer == pytest.approx(share, rel=0.05)


def test_it_is_no_less_than_what_one_parameter_alone_takes():
    """The scale factor by itself: all energy at the resonance, every sample at the limit."""
    wish = wished({"position": 0.02})
    zeta = FIG_17.damping_ratio
    peak = 1.0 / (2.0 * zeta * np.sqrt(1.0 - zeta**2))
    samples = wish.duration * wish.fs
    alone = wish.noise_std / (0.02 * peak * np.sqrt(samples)) / wish.wanted(FIG_17)[3]
    assert least_share(wish) > alone


def test_a_range_takes_more_than_its_middle_and_nothing_takes_no_share():
    one = wished(TIGHT[1])
    wide = replace(one, model_range=ModelRange(natural_frequency=(7.0, 14.0)))
    assert least_share(wide) > 1.3 * least_share(one)
    assert least_share(wished({}, gentle="travel")) == 0.0


def test_what_no_stimulus_can_give_is_refused_without_a_search(monkeypatch):
    def searched(*_given, **_more):
        raise AssertionError

    monkeypatch.setattr(search_module, "_best", searched)
    message = r"needs (\S+) times the limits, and none of any shape does with (\S+) times"
    for families in (("multisine",), ("exponential",)):
        with pytest.raises(LimitsError, match=message):
            gentlest(
                accuracy=Accuracy(),
                model=FIG_17,
                noise_std=0.1,
                limits=Limits(acceleration=200.0),
                fs=200.0,
                duration=2.0,
                families=families,
            )
