"""Results that were written by the first version, read as if written now."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hmpim.identify.result.powers import by_falling_powers

__all__ = ["FIRST_SCHEMA", "upgraded"]

FIRST_SCHEMA = "hmpim/identification/1"


def upgraded(pair: Mapping[str, Any]) -> dict[str, Any]:
    """Return a pair of schema 1 as one of schema 2.

    Schema 1 has its covariance by rising powers, and one verdict for the pair. Where that is not
    ok, nothing says which of its warnings casts the doubt, nor on what: all of them do, on
    everything.
    """
    trusted = pair["verdict"] == "ok"

    def judged(estimates: Mapping[str, Any]) -> dict[str, Any]:
        verdict = "ok" if trusted else "doubtful"
        return {n: None if e is None else {**e, "verdict": verdict} for n, e in estimates.items()}

    parameters = judged(pair["parameters"])
    dynamics = pair["dynamics"]
    nonlinearity = pair.get("nonlinearity")
    size = None if nonlinearity is None else nonlinearity["size"]
    return {
        **pair,
        "parameters": parameters,
        "dynamics": {**dynamics, "covariance": _falling(dynamics)},
        "bandwidths_from_response": judged(pair.get("bandwidths_from_response", {})),
        "nonlinearity": None
        if nonlinearity is None
        else {**nonlinearity, "size": judged({"size": size})["size"]},
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


def _falling(dynamics: Mapping[str, Any]) -> list[list[float]] | None:
    covariance = dynamics.get("covariance")
    if covariance is None:
        return None
    rising = np.asarray(covariance, dtype=np.float64)
    turned: list[list[float]] = by_falling_powers(rising, len(dynamics["numerator"])).tolist()
    return turned
