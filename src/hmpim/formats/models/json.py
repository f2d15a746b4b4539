"""JSON: the model, its errors and its origin as plain values."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hmpim.formats.atomic import write_text
from hmpim.formats.models.source import Source

__all__ = ["SCHEMA", "json_document", "write_json"]

SCHEMA = "hmpim/model/1"


def json_document(source: Source) -> dict[str, Any]:
    """Return the document; coefficients highest power of s first, covariance as it says."""
    model, pair, record = source.model, source.pair, source.record
    spread = model.spread
    top = len(model.numerator) - 1
    above = [f"scale_factor * numerator s^{top - i}" for i in range(top + 1)]
    below = range(len(model.denominator) - 1, 1 if model.denominator[-1] == 0.0 else 0, -1)
    return {
        "schema": SCHEMA,
        "input": pair.input,
        "output": pair.output,
        "output_unit": model.output_unit,
        "delay": model.delay,
        "scale_factor": model.scale_factor,
        "numerator": list(model.numerator),
        "denominator": list(model.denominator),
        "bias": model.bias,
        "noise_std": model.noise_std,
        "saturation": [model.saturation_low, model.saturation_high],
        "hold_period": model.hold_period,
        "quantization_step": model.quantization_step,
        "nonlinear": None if model.nonlinear is None else model.nonlinear.to_dict(),
        "intersample": model.intersample,
        "fs": model.fs,
        "band": model.band,
        "parameters": {name: estimate.to_dict() for name, estimate in source.estimates()},
        "covariance": None
        if spread is None
        else {
            "of": ["delay", *above, *(f"denominator s^{power}" for power in below)],
            "values": [list(row) for row in spread.covariance],
        },
        "modes": [asdict(mode) for mode in model.modes],
        "structure": pair.structure,
        "fit_percent": pair.fit_percent,
        "verdict": pair.verdict,
        "warnings": [warning.to_dict() for warning in pair.warnings],
        "record": {
            "sha256": record.sha256,
            "fs": record.fs,
            "samples": record.samples,
            "source": record.source,
        },
        "hmpim": source.version,
    }


def write_json(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the document."""
    write_text(path, json.dumps(json_document(source), indent=1, allow_nan=False) + "\n")
    return (path,)
