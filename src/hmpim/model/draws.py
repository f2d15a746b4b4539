"""Models drawn from what an identification leaves open: a study gets the uncertainty along."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked, generator, numbers_of
from hmpim.errors import ArgumentError
from hmpim.model.model import Model
from hmpim.model.response import by_falling_powers, response_std

__all__ = ["coefficient_vector", "draw_models", "response_error", "with_coefficients"]

_TRIES = 100
"""Draws made for each one kept, before giving up."""


def coefficient_vector(model: Model) -> NDArray[np.float64]:
    """Delay, numerator times scale factor, denominator before its last coefficient not 0.

    By falling powers of s, as the model has them and `Spread.covariance` counts them.

    Examples
    --------
    >>> model = Model(delay=0.1, scale_factor=2.0, denominator=(0.25, 0.5, 1.0))
    >>> coefficient_vector(model).tolist()
    [0.1, 2.0, 0.25, 0.5]
    """
    rational = model.system
    behind = 2 if model.denominator[-1] == 0.0 else 1
    return np.concatenate(
        [[rational.delay], rational.numerator[::-1], rational.denominator[behind:][::-1]]
    )


def with_coefficients(model: Model, vector: NDArray[np.float64]) -> Model:
    """The model with other coefficients, in the order of `coefficient_vector`.

    Raises
    ------
    ArgumentError
        If they make no model: the scale factor is 0, or it is not stable.
    """
    above = 1 + len(model.numerator)
    numerator = vector[1:above]
    lowest = (1.0, 0.0) if model.denominator[-1] == 0.0 else (1.0,)
    if not numerator.any():
        raise ArgumentError("a scale factor of 0 is not a model")
    scale = float(numerator[np.flatnonzero(numerator)[-1]])
    return replace(
        model,
        delay=float(vector[0]),
        scale_factor=scale,
        numerator=tuple((numerator / scale).tolist()),
        denominator=(*vector[above:].tolist(), *lowest),
    )


def response_error(model: Model, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation of a model's response, sqrt(E|error|²), to first order.

    Parameters
    ----------
    model : Model
        The model.
    frequency : ndarray, shape (m,)
        Hz, above 0.

    Returns
    -------
    ndarray, shape (m,)
        In the response's unit; NaN without a spread.

    Examples
    --------
    A delay that is known to 1 ms turns the response by 2π/1000 at 1 Hz:

    >>> from hmpim.model import Spread
    >>> known = Spread(covariance=((1e-6, 0.0), (0.0, 0.0)))
    >>> late = Model(delay=0.1, scale_factor=1.0, spread=known)
    >>> response_error(late, np.array([1.0])).round(6).tolist()
    [0.006283]
    """
    if model.spread is None:
        return np.full(np.shape(frequency), np.nan)
    covariance = by_falling_powers(np.array(model.spread.covariance), model.system.numerator.size)
    return response_std(model.system, covariance, numbers_of("frequency", frequency))


@checked
def draw_models(
    model: Model, count: int, *, rng: np.random.Generator | int | None = None
) -> tuple[Model, ...]:
    """Draw models as likely as the record leaves them.

    Delay and coefficients are drawn together from their covariance; bias, noise, levels, hold,
    rounding and the size of a nonlinear part each from its own standard deviation. A draw that no
    `Model` can be, such as an unstable one, is drawn again.

    Parameters
    ----------
    model : Model
        With a `spread`, as from `hmpim.to_model`.
    count : int
        How many.
    rng : numpy.random.Generator or int, optional
        Source of chance, or its seed.

    Returns
    -------
    tuple of Model, length count
        Without a spread of their own.

    Raises
    ------
    ArgumentError
        If the model has no spread, or hardly any draw is one that can be simulated.

    Examples
    --------
    >>> from hmpim.model import Spread
    >>> spread = Spread(covariance=((1e-8, 0.0), (0.0, 1e-4)), bias=0.02)
    >>> model = Model(delay=0.1, scale_factor=2.0, spread=spread)
    >>> drawn = draw_models(model, 500, rng=1)
    >>> round(float(np.std([m.delay for m in drawn])), 5)
    0.0001
    """
    spread = model.spread
    if spread is None:
        raise ArgumentError(
            "the model says nothing of its errors; make it with hmpim.to_model from a result that "
            "has a covariance"
        )
    if count < 0:
        raise ArgumentError(f"count = {count!r} models cannot be drawn; give 0 or more")
    source = generator(rng)
    mean, covariance = coefficient_vector(model), np.array(spread.covariance)
    if covariance.shape != (mean.size, mean.size):
        raise ArgumentError(
            f"the covariance is {covariance.shape[0]} by {covariance.shape[-1]} for {mean.size} "
            "coefficients; it belongs to another model"
        )
    size = np.where(np.diag(covariance) > 0, np.sqrt(np.abs(np.diag(covariance))), 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    drawn: list[Model] = []
    tries = 0
    while len(drawn) < count:
        tries += 1
        if tries > _TRIES * count:
            raise ArgumentError(
                f"of {tries - 1} draws only {len(drawn)} can be simulated: the coefficients are "
                "barely known; measure longer, or identify with plainer structures"
            )
        try:
            drawn.append(_one(model, mean + root @ source.standard_normal(mean.size), source))
        except ArgumentError:
            continue
    return tuple(drawn)


def _one(model: Model, vector: NDArray[np.float64], source: np.random.Generator) -> Model:
    spread = model.spread
    assert spread is not None

    def moved(value: float | None, std: float) -> float | None:
        return None if value is None else float(value + std * source.standard_normal())

    noise = moved(model.noise_std, spread.noise_std)
    assert noise is not None
    drawn = replace(
        with_coefficients(model, vector),
        bias=moved(model.bias, spread.bias) or 0.0,
        noise_std=abs(noise),
        saturation_low=moved(model.saturation_low, spread.saturation_low),
        saturation_high=moved(model.saturation_high, spread.saturation_high),
        hold_period=moved(model.hold_period, spread.hold_period),
        quantization_step=moved(model.quantization_step, spread.quantization_step),
        spread=None,
    )
    part = model.nonlinear
    if part is None:
        return drawn
    size = part.size + part.std * source.standard_normal()
    return replace(drawn, nonlinear=replace(part, size=size))
