"""Results that were written by the first version, converted to the present schema."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hmpim.model.response import by_falling_powers

__all__ = ["FIRST_SCHEMA", "upgraded"]

FIRST_SCHEMA = "hmpim/identification/1"


def upgraded(pair: Mapping[str, Any]) -> dict[str, Any]:
    """Return a pair of schema 1 as one of schema 2.

    Schema 1 has its covariance by rising powers, and one verdict for the pair. Where that is not
    ok, the cause is not recorded: every warning is taken to doubt every parameter.
    """
    trusted = pair["verdict"] == "ok"

    def judged(estimates: Mapping[str, Any]) -> dict[str, Any]:
        verdict = "ok" if trusted else "doubtful"
        return {n: None if e is None else {**e, "verdict": verdict} for n, e in estimates.items()}

    parameters = judged(pair["parameters"])
    dynamics = pair["dynamics"]
    covariance, nonlinearity = dynamics.get("covariance"), pair.get("nonlinearity")
    if covariance is not None:
        rising = np.asarray(covariance, dtype=np.float64)
        covariance = by_falling_powers(rising, len(dynamics["numerator"])).tolist()
    if nonlinearity is not None:
        nonlinearity = {**nonlinearity, **judged({"size": nonlinearity["size"]})}
    return {
        **pair,
        "parameters": parameters,
        "dynamics": {**dynamics, "covariance": covariance},
        "bandwidths_from_response": judged(pair.get("bandwidths_from_response", {})),
        "nonlinearity": nonlinearity,
        "warnings": [
            {
                "code": warning["code"],
                "message": warning["message"],
                "severity": "info" if trusted else "doubt",
                "parameters": [] if trusted else list(parameters),
            }
            for warning in pair["warnings"]
        ],
    }
