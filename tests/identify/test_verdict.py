"""What speaks against a result must cast doubt on it."""

import re
from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.fitting.joint import Trial, joint_fit
from hmpim.identify.readings import read_parameters
from hmpim.identify.verdict import judge
from hmpim.identify.whiteness import misfit
from hmpim.model.dynamics import STRUCTURES

FS = 200.0


@pytest.fixture(scope="module")
def joint(field_record):
    _, u, y = field_record
    return u, joint_fit(u, y + 0.1 * np.random.default_rng(0).standard_normal(y.size))


def verdict(u, fitted):
    readings = read_parameters(
        fitted, fs=FS, highest=20.0, delay_correlation=None, input_unit="", output_unit=""
    )
    fit = fitted.best.fit
    left = misfit(u, fit.residual, delay=fit.delay, band=(0.1 / FS, 20.0 / FS))
    return judge(fitted, readings, left, fs=FS, band=(0.1, 20.0), fit_percent=90.0)


def with_rival(fitted, *, delay, lag, criterion):
    """Add a first-order fit that came out so, its criterion so much worse."""
    rival = replace(
        fitted.best.fit,
        structure=STRUCTURES["first_order"],
        theta=np.array([fitted.best.fit.delay + delay, np.log(lag)]),
    )
    trial = Trial(
        intersample=fitted.best.intersample,
        fit=rival,
        criterion=fitted.best.criterion + criterion,
    )
    return replace(fitted, trials=(*fitted.trials, trial))


def test_a_rival_as_likely_that_says_another_delay_or_bandwidth_casts_doubt(joint):
    u, fitted = joint
    assert verdict(u, fitted).verdict == "ok"
    for rival, words in (
        (with_rival(fitted, delay=2.0, lag=0.1, criterion=1.0), "delay .* standard deviations"),
        (with_rival(fitted, delay=0.0, lag=20.0, criterion=1.0), "bandwidth at .* instead of"),
    ):
        judged = verdict(u, rival)
        assert judged.verdict == "doubtful"
        (finding,) = [f for f in judged.findings if f.code == "structure"]
        assert re.search(words, finding.message)
    unlikely = with_rival(fitted, delay=2.0, lag=20.0, criterion=50.0)
    assert verdict(u, unlikely).verdict == "ok"


def with_assumption(fitted, name, *, delay, criterion):
    """Add a fit under a held input that came out so, its criterion so much worse."""
    rival = replace(
        fitted.best.fit,
        structure=STRUCTURES[name],
        theta=np.array([fitted.best.fit.delay + delay, *fitted.best.fit.theta[1:]]),
    )
    trial = Trial(intersample="zoh", fit=rival, criterion=fitted.best.criterion + criterion)
    kept = tuple(t for t in fitted.trials if t.intersample == fitted.best.intersample)
    return replace(fitted, trials=(*kept, trial))


@pytest.mark.parametrize(
    ("name", "criterion", "expected", "words"),
    [
        ("second_order", 1.0, "ok", "cannot tell. .* move the delay by -0.50 samples"),
        ("second_order", -2.0, "ok", "cannot tell"),
        ("second_order", -8.0, "doubtful", "speaks for the other, though not clearly"),
        ("first_order", -2.0, "doubtful", "held, a first-order model fits as well"),
    ],
)
def test_another_assumption_between_samples_casts_doubt(joint, name, criterion, expected, words):
    """If it is rather the likelier one, or asks for another structure; else it is named."""
    u, fitted = joint
    judged = verdict(u, with_assumption(fitted, name, delay=-0.5, criterion=criterion))
    (finding,) = [f for f in judged.findings if f.code == "intersample"]
    assert re.search(words, finding.message)
    assert judged.verdict == expected
