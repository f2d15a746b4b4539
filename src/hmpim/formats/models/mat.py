"""MAT: the model and its response as a MATLAB struct, for `load`."""

from pathlib import Path
from typing import Any

import numpy as np

from hmpim.formats.atomic import replacing
from hmpim.formats.models.json import json_document
from hmpim.formats.models.response import response_of
from hmpim.formats.models.source import Source

__all__ = ["write_mat"]


def write_mat(source: Source, path: Path) -> tuple[Path, ...]:
    """Write a file of version 5 with one struct, named as the model; null becomes []."""
    from scipy.io import savemat

    document = json_document(source)
    seen = response_of(source)
    document["response"] = {
        "frequency": seen.frequency,
        "measured": seen.measured,
        "measured_std": seen.measured_std,
        "model": seen.model,
        "model_std": seen.model_std,
    }
    document["about"] = source.lines()
    with replacing(path) as place:
        savemat(place, {source.name[:31]: _plain(document)}, oned_as="column", appendmat=False)
    return (path,)


def _plain(value: Any) -> Any:
    """Turn JSON values into what MATLAB has."""
    if value is None:
        return np.zeros((0, 0))
    if isinstance(value, dict):
        return {key[:31]: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        if not value or all(isinstance(v, (int, float)) for v in value):
            return np.array(value, dtype=float).reshape(1, -1)
        if all(isinstance(v, list) for v in value):
            return np.array(value, dtype=float)
        cells = np.empty((len(value), 1), dtype=object)
        for i, inner in enumerate(value):
            cells[i, 0] = _plain(inner)
        return cells
    return value
