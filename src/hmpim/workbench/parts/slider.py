"""A slider whose number follows the hand, and words that change without drawing the page anew.

A change to an element of NiceGUI's own draws the whole page anew in the browser. What follows a
hand goes to its own part of the page alone, as a picture's curves do.
"""

from collections.abc import Callable
from typing import Any

from nicegui import events
from nicegui.element import Element

__all__ = ["Slider", "Words"]

_BETWEEN = 0.03  # s between two values that are told while a hand moves


class Slider(Element, component="slider.js"):
    """A slider: its name, the number it stands for, and the browser's own range input.

    Parameters
    ----------
    words : str
        What it sets; its name for those who hear the page.
    ends : tuple of float
        Lowest and highest value.
    step : float
        Between two values.
    value : float
        Where it stands at first.
    on_slide : callable
        Called with the value to which a hand or a key has moved it, never after `stand`.
    """

    def __init__(
        self,
        words: str,
        *,
        ends: tuple[float, float],
        step: float,
        value: float,
        on_slide: Callable[[float], Any],
    ) -> None:
        super().__init__()
        self.value = value
        self._said = f"{value:g}"
        given = {"words": words, "low": ends[0], "high": ends[1], "step": step}
        self._props.update({**given, "at": value, "said": self._said})

        def slid(event: events.GenericEventArguments) -> Any:
            self.value = float(event.args)
            return on_slide(self.value)

        self.on("slid", slid, throttle=_BETWEEN)

    def stand(self, value: float) -> None:
        """Move it, without anybody being told."""
        self.value = value
        self._keep(at=value)
        self.run_method("stand", value)

    def say(self, words: str) -> None:
        """Show these words as its number."""
        if words != self._said:
            self._said = words
            self._keep(said=words)
            self.run_method("say", words)

    def _keep(self, **props: Any) -> None:
        with self._props.suspend_updates():
            self._props.update(props)


class Words(Element, component="words.js"):
    """A line that says how things stand.

    Parameters
    ----------
    tone : {'ok', 'doubt', 'bad', 'soft'}
        Its colour.
    """

    def __init__(self, tone: str = "soft") -> None:
        super().__init__()
        self._props.update({"said": "", "tone": tone})

    def say(self, words: str, tone: str) -> None:
        """Say this instead."""
        if (words, tone) == (self._props["said"], self._props["tone"]):
            return
        with self._props.suspend_updates():
            self._props.update({"said": words, "tone": tone})
        self.run_method("say", words, tone)
