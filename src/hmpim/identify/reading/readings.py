"""Parameters of the result, read off the fitted model, each with its error bar."""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.derivatives import jacobian, products
from hmpim.identify.fitting.held_steps import is_known_to_a_sample
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.autoregression import deviation_of_mean
from hmpim.identify.noise.covariance import covariance, white_covariance
from hmpim.identify.noise.level import steadiness
from hmpim.identify.noise.whiteness import is_steady, is_white
from hmpim.identify.reading.figures import read_figures
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.error_bars import noise_estimate
from hmpim.model.filters import in_z
from hmpim.model.response import RationalDelay, by_falling_powers

__all__ = ["Readings", "from_lag", "read_parameters"]


_ROUNDING = 1e-13
"""Relative error of the output (r.m.s.) by rounding, even if the residual is smaller."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """The parameters of a fit, its system, and their covariance."""

    parameters: Parameters
    system: RationalDelay  # in seconds, the scale factor included
    vector: Real  # (p,): delay and denominator sections, both in samples; numerator; bias
    covariance: Real  # (p, p): of `vector`
    white: bool  # whether the residual is white
    # (2, p + 1, p + 1): products of the derivatives of the prediction and `innovations` over either
    # half of the record, from `hmpim.identify.fitting.derivatives.products`
    halves: Real
    innovations: Real  # (n,): the residual, whitened
    # (q, q): of the delay and the coefficients of `system` that may vary, by rising powers of s
    coefficient_covariance: Real

    @property
    def coefficients(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Numerator and denominator of unit gain, highest power first: of s, or of z for software.

        The denominator has a coefficient of 1 at s⁰, or at the highest power of z.
        """
        above, below = self.system.numerator, self.system.denominator
        if above.any():  # the first that is not 0 is the scale factor
            above = above / above[np.flatnonzero(above)[0]]
        if self.system.step is not None:
            length = max(above.size, below.size)
            above, below = (np.pad(in_z(c), (0, length - c.size))[::-1] for c in (above, below))
            above, below = above / below[-1], below / below[-1]
        return tuple(above[::-1].tolist()), tuple(below[::-1].tolist())

    @property
    def by_falling_powers(self) -> Real | None:
        """Covariance of delay, numerator and denominator, (q, q), highest power first.

        None where it is not finite, because the record does not determine every parameter.
        """
        known = self.coefficient_covariance
        finite = np.isfinite(known).all()
        return by_falling_powers(known, self.system.numerator.size) if finite else None


def read_parameters(
    joint: JointFit,
    *,
    fs: float,
    highest: float,
    delay_correlation: float | None,
    known_covariance: Real | None = None,
    units: tuple[str, str],
) -> Readings:
    """Turn the chosen fit into estimates.

    No bandwidth is read off beyond `highest`, in Hz: the end of the excited band. The paper's delay
    (eq. 8) is in s. `known_covariance`, (p, p), is that of the fit's parameters, where several
    inputs were fitted together.
    """
    fit = joint.best.fit
    structure = fit.structure
    vector = np.concatenate([fit.theta, fit.linear])
    if is_known_to_a_sample(joint.problem.source, structure):
        vector[0] = np.ceil(np.round(vector[0], 6)) - 0.5  # the middle of its last sample
    weighed = joint.weighed
    freedom = max(weighed.counted - vector.size, 1)
    residual = weighed.innovations(fit.prediction, fit.residual)
    white = is_white(weighed.counting(residual))
    tested = joint.hidden
    halves = tested.halves if tested is not None and tested.fit is fit else None
    if halves is None:
        halves = products(weighed, fit, residual, edges=(residual.size // 2,))
    cov = known_covariance
    if cov is None:
        gram = halves.sum(axis=0)[:-1, :-1]
        cov = _covariance(joint, gram, residual, freedom=freedom, white=white)
    if weighed.is_coloured:
        cov = _wandering(cov, fit.residual, joint.problem.counted)
    parameters, system, coefficients = read_figures(
        structure,
        vector,
        cov,
        fs=fs,
        highest=highest,
        effective=freedom * joint.weighed_share,
        noise=noise_estimate(
            fit.cost,
            freedom=max(joint.problem.counted - vector.size, 1),
            share=joint.effective_share * steadiness(weighed.as_loud(residual)),
            unit=units[1],
        ),
        units=units,
    )
    return Readings(
        parameters=replace(parameters, delay_correlation=from_lag(delay_correlation, fs)),
        system=system,
        vector=vector,
        covariance=cov,
        white=white and not weighed.is_coloured,
        halves=halves,
        innovations=residual,
        coefficient_covariance=coefficients,
    )


def _covariance(joint: JointFit, gram: Real, residual: Real, *, freedom: int, white: bool) -> Real:
    """Covariance of theta and linear; a held, static system moves in whole samples only."""
    fit = joint.best.fit
    whole = is_known_to_a_sample(joint.problem.source, fit.structure)
    whole = whole or fit.structure.sampled  # its delay is a number of samples
    free = slice(int(whole), None)
    inner = None
    if white and is_steady(residual):
        power = float(residual @ residual)
        inner = white_covariance(gram[free, free], power, freedom=freedom)
    if inner is None:
        rows = jacobian(joint.weighed, fit)[free]
        inner = covariance(rows, residual, freedom=freedom, white=white)
    if not whole:
        return inner
    full = np.zeros_like(gram)
    full[1:, 1:] = inner
    if fit.structure.sampled:
        rounding = _ROUNDING**2 * float(joint.problem.y @ joint.problem.y)
        full *= 1.0 + rounding / max(fit.cost, 1e-3 * rounding)
    elif not fit.structure.order:  # else the ends of the sample are read: `spanned`
        full[0, 0] = 1.0 / 12.0  # uniform over the sample in which the delay ends
    return full


def _wandering(cov: Real, residual: Real, counted: int) -> Real:
    """Widen the bias for noise that rises towards DC, where an autoregression does not."""
    known = deviation_of_mean(residual, counted) ** 2
    if known <= cov[-1, -1]:
        return cov
    stretch = np.ones(cov.shape[0])
    stretch[-1] = np.sqrt(known / cov[-1, -1])
    return np.asarray(cov * np.outer(stretch, stretch))


def from_lag(delay: float | None, fs: float) -> Estimate | None:
    """The paper's delay is a whole number of samples: uniform over one sample."""
    if delay is None:
        return None
    half = 0.5 / fs
    return Estimate(value=delay, std=half / np.sqrt(3), ci95=(delay - half, delay + half), unit="s")
