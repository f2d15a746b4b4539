"""Which nonlinearity the harmonics of a sweep look like.

Each kind (`hmpim.identify.nonlinear.mechanisms`) makes harmonics of its own amplitude, phase, and
course along the sweep. Its trace is regressed on the harmonics as the residual was, and the two
sets of weights are compared, orders 2 and up only. What follows the sweep at its own frequency
does not count: dynamics left out look like nothing here, and what of a nonlinearity the linear
fit took up does not lessen its size.
"""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.nonlinear.harmonic_regression import HarmonicFit
from hmpim.identify.nonlinear.mechanisms import Hypothesis, Kind, Mechanism, hypotheses

__all__ = ["compare_harmonics"]


def compare_harmonics(
    fit: HarmonicFit, x: Real, denominator: Real, *, fs: float
) -> tuple[Mechanism, ...]:
    """Hold the harmonics of each kind against those seen, the likeliest first.

    Parameters
    ----------
    fit : HarmonicFit
        Regression of the residual.
    x : ndarray, shape (n,)
        The linear model's output less its bias.
    denominator : ndarray
        Of the dynamics that a force goes through, by rising powers of s per sample.
    fs : float
        Rate in Hz.

    Returns
    -------
    tuple of Mechanism
        One of each kind whose weight has the right sign. `Mechanism.rms` is that of its
        harmonics.

    Examples
    --------
    >>> from hmpim.identify.nonlinear.harmonics import sweep_harmonics
    >>> from hmpim.identify.nonlinear.mechanisms import play
    >>> u = np.sin(np.arange(3000) / 30 * (1 + np.arange(3000) / 3000))
    >>> y = play(u, 0.1) + 0.01 * np.random.default_rng(0).standard_normal(3000)
    >>> seen = sweep_harmonics(u, y - u, 100.0)
    >>> best = compare_harmonics(seen.regression, u, np.ones(1), fs=100.0)[0]
    >>> best.kind, round(best.size, 2)
    ('backlash', 0.1)
    """
    tried = list(hypotheses(x, denominator, fs))
    group = fit.group(2, 2 * len(fit.orders))
    values, vectors = np.linalg.eigh(fit.covariance[np.ix_(group, group)])
    kept = values > 1e-12 * values[-1]
    whiten = vectors[:, kept] / np.sqrt(values[kept])  # to unit variance each
    seen = fit.weights[group] @ whiten
    traces = np.stack([one.trace for one in tried])
    weights = fit.weights_of(traces)
    best: dict[Kind, tuple[float, float, Hypothesis, Real]] = {}
    for one, own in zip(tried, weights, strict=True):
        made = own[group] @ whiten
        power, along = float(made @ made), float(made @ seen)
        if power <= 0 or along <= 0:
            continue
        gain = 0.5 * along**2 / power
        if one.kind not in best or gain > best[one.kind][0]:
            best[one.kind] = (gain, along / power, one, own)
    found = []
    for gain, weight, one, own in best.values():
        scatter = float(np.linalg.norm(own[group] @ whiten)) ** -1
        found.append(
            Mechanism(
                kind=one.kind,
                size=weight if one.size is None else one.size,
                size_std=float(np.hypot(scatter if one.size is None else 0.0, one.spacing)),
                gain=gain,
                likelihood=gain,
                rms=weight * fit.power(own, group) ** 0.5,
                effect=weight * float(np.std(one.trace[fit.view.index])),
                trace=one.trace,
            )
        )
    return tuple(sorted(found, key=lambda m: -m.likelihood))
