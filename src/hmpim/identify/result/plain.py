"""Results as plain JSON values."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

__all__ = ["plain"]


def plain(value: Any) -> Any:
    """Return a dataclass by its fields, arrays and tuples as lists, and all else as it is.

    Examples
    --------
    >>> plain((np.zeros(2), None))
    [[0.0, 0.0], None]
    """
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(one) for one in value] if isinstance(value, tuple) else value
