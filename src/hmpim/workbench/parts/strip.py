"""A live strip of one axis: command and response in the last seconds, and their limit."""

import base64
import time
from typing import Any

import numpy as np
from nicegui.element import Element
from numpy.typing import NDArray

from hmpim.workbench.live import Live

__all__ = ["SPAN", "Strip"]

SPAN = 5.0
"""Seconds of a run that are seen."""
_PATIENCE = 2.0  # s after which a frame that was not drawn counts as lost
_MOST = 600  # samples of a channel that are sent at a time: more than a strip has columns


class Strip(Element, component="strip.js"):
    """A strip chart of one axis.

    Parameters
    ----------
    live : Live
        Where the samples come in.
    axis : str
        Whose.
    limit : float or None
        Largest position, in the command's unit.
    """

    def __init__(self, live: Live, axis: str, *, limit: float | None) -> None:
        super().__init__()
        self._axis = axis
        self._sent = 0.0
        self._shown = True
        self._blocks = -1
        self.on("shown", self._seen, [])
        channels = live.of(axis)
        names = [channels[role].name if role in channels else role for role in _ROLES]
        self._props["label"] = f"Command and response of {axis or names[1]}, live"
        self._props["names"] = names
        self._props["unit"] = channels["input"].unit if "input" in channels else ""
        self._props["limit"] = limit
        self._props["span"] = SPAN

    def follow(self, live: Live) -> None:
        """Show the last seconds of what has come in, once the browser has drawn what it got."""
        now = time.monotonic()
        if live.blocks == self._blocks and (self._shown or not live.blocks):
            return  # nothing has come since
        if not self._shown and now - self._sent < _PATIENCE:
            return
        self._shown, self._sent, self._blocks = False, now, live.blocks
        channels = live.of(self._axis)
        sent: list[Any] = []
        for role in _ROLES:
            if role in channels:
                x, y = channels[role].last(SPAN, end=live.end, most=_MOST)
                sent.append([_bytes(x), _bytes(y)])
            else:
                sent.append(["", ""])
        self.run_method("show", live.end, *sent)

    def _seen(self) -> None:
        self._shown = True


_ROLES = ("input", "output")


def _bytes(values: NDArray[np.float64]) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode()
