"""The response that an export carries: measured and modelled, each with its error."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.models.source import Source
from hmpim.model import frequency_response, response_error

__all__ = ["Response", "response_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Response by frequency, delay included, in output unit per input unit.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz.
    measured, model : complex ndarray, shape (m,)
        As measured, and of the model.
    measured_std, model_std : ndarray, shape (m,)
        sqrt(E|error|²) of each; NaN where the record does not determine it.
    """

    frequency: NDArray[np.float64]
    measured: NDArray[np.complex128]
    measured_std: NDArray[np.float64]
    model: NDArray[np.complex128]
    model_std: NDArray[np.float64]


def response_of(source: Source) -> Response:
    """Return the response of a source at the frequencies at which it was measured."""
    seen, model = source.pair.frequency_response, source.model
    return Response(
        frequency=seen.frequency,
        measured=seen.response,
        measured_std=seen.std,
        model=frequency_response(model, seen.frequency),
        model_std=response_error(model, seen.frequency),
    )
