"""The page that designs: what is wished, sliders, and all that follows from them."""

from dataclasses import replace
from typing import Any

from nicegui import ui

from hmpim.errors import HmpimError
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import AxisRow, Wish
from hmpim.workbench.pages.frame import Command, Later, card, failures_said
from hmpim.workbench.parts.picture import Picture
from hmpim.workbench.parts.table import plain_table
from hmpim.workbench.work.designed import Designed, designed, five_axes, save_design
from hmpim.workbench.workers import Latest

__all__ = ["design"]


def design(window: Window) -> Later:
    """Make the page."""
    return DesignPage(window).draw


class DesignPage:
    """The page in one window.

    Parameters
    ----------
    window : Window
        Whose it is.
    """

    def __init__(self, window: Window) -> None:
        self.window = window
        self.latest = Latest()
        self.pictures: dict[str, Picture] = {}
        with ui.element("div").classes("hm-side"):
            with card("Sliders"):
                self._sliders()
            with card("Test"):
                self._numbers(self.wish, self._set, _TEST)
                ui.input("Unit", value=self.wish.unit, on_change=lambda e: self._set(unit=e.value))
            self.rows = ui.element("div").classes("hm-side")
            with card("What is roughly known"):
                self._numbers(self.wish.model, self._model, _MODEL)
        with ui.element("div").classes("hm-body"):
            with card("Design"):
                self.said = ui.label().classes("hm-verdict").props('role="status"')
                self.tables = ui.element("div").classes("hm-body")
                with ui.element("div").classes("hm-row"):
                    ui.button("Save and download", icon="download", on_click=self._save)
            with card("Pictures"):
                self.plot = ui.element("div")
        self.command = Command()
        self._axes()

    @property
    def wish(self) -> Wish:
        """What is wished."""
        return self.window.desk.wish

    async def draw(self) -> None:
        """Design, and show it; of many wishes only the latest."""
        await self.latest(self._draw)

    def _set(self, **changes: Any) -> Any:
        if any(value is None for name, value in changes.items() if name in _NEEDED):
            return None
        self.window.change(wish=replace(self.wish, **changes))
        return self.draw()

    def _model(self, **changes: Any) -> Any:
        if None in changes.values():
            return None
        return self._set(model=replace(self.wish.model, **changes))

    def _row(self, k: int, **changes: Any) -> Any:
        if None in changes.values():
            return None
        rows = list(self.wish.rows)
        rows[k] = replace(rows[k], **changes)
        return self._set(rows=tuple(rows))

    def _numbers(self, held: Any, change: Any, fields: dict[str, str]) -> None:
        with ui.element("div").classes("hm-row"):
            for name, words in fields.items():
                ui.number(
                    words,
                    value=getattr(held, name),
                    on_change=lambda e, name=name: change(**{name: e.value}),
                ).props("debounce=300 step=any")

    def _sliders(self) -> None:
        row = self.wish.rows[0]
        self._slider("Amplitude", 0.01, 1.0, row.amplitude / row.position, self._amplitude)
        self._slider("Extinction n (0: as small as fits)", 0.0, 3.0, self.wish.extinction or 0.0,
                     lambda v: self._set(extinction=v or None))  # fmt: skip
        self._slider("Lead, s (0: as gentle as fits)", 0.0, 2.0, self.wish.lead or 0.0,
                     lambda v: self._set(lead=v or None))  # fmt: skip
        self._slider("Window α", 0.1, 5.0, self.wish.alpha, lambda v: self._set(alpha=v))

    def _slider(self, words: str, low: float, high: float, value: float, change: Any) -> None:
        with ui.element("div"):
            with ui.element("div").classes("hm-row"):
                ui.label(words)
                shown = ui.label().classes("hm-soft")
            slider = ui.slider(min=low, max=high, step=0.01, value=round(value, 2))
            slider.props(f'aria-label="{words}" label')
            shown.bind_text_from(slider, "value", lambda v: f"{v:g}")
            slider.on_value_change(lambda e: change(float(e.value)))

    def _amplitude(self, share: float) -> Any:
        rows = tuple(replace(r, amplitude=share * r.position) for r in self.wish.rows)
        return self._set(rows=rows)

    def _axes(self) -> None:
        self.rows.clear()
        with self.rows:
            for k, row in enumerate(self.wish.rows):
                with card(f"Axis {row.name or k + 1}"):
                    ui.input(
                        "Name, as the rig calls it",
                        value=row.name,
                        on_change=lambda e, k=k: self._row(k, name=e.value.strip()),
                    ).props("debounce=300")
                    self._numbers(row, lambda k=k, **c: self._row(k, **c), _AXIS)
            with ui.element("div").classes("hm-row"):
                ui.button("Add an axis", on_click=self._more).props("flat")
                if len(self.wish.rows) > 1:
                    ui.button("Remove the last", on_click=self._fewer).props("flat")
                ui.button("The five axes of Fig. 4", on_click=self._five).props("flat")

    async def _more(self) -> None:
        rows = self.wish.rows
        names = [r.name or f"axis{k}" for k, r in enumerate(rows, start=1)]
        named = [replace(r, name=n) for r, n in zip(rows, names, strict=True)]
        self.window.change(
            wish=replace(self.wish, rows=(*named, AxisRow(name=f"axis{len(rows) + 1}")))
        )
        self._axes()
        await self.draw()

    async def _fewer(self) -> None:
        self.window.change(wish=replace(self.wish, rows=self.wish.rows[:-1]))
        self._axes()
        await self.draw()

    async def _five(self) -> None:
        self.window.change(
            wish=replace(self.wish, rows=five_axes(), unit="deg", extinction=None, lead=None)
        )
        self._axes()
        await self.draw()

    async def _draw(self) -> None:
        try:
            found = await self.window.workbench.workers.soon(designed, self.wish)
        except HmpimError as error:
            if self.said.is_deleted:  # the page was left meanwhile
                return
            self.said.set_text(" ".join(str(error).split()))
            self.said.classes(replace="hm-verdict hm-bad")
            return
        if not self.said.is_deleted:
            self._show(found)

    def _show(self, found: Designed) -> None:
        self.said.set_text(found.words)
        self.said.classes(replace="hm-verdict hm-ok" if found.inside else "hm-verdict hm-bad")
        self.command.show(found.command)
        self.tables.clear()
        with self.tables:
            plain_table(
                ("Axis", "Quantity", "Peak", "Limit", ""), found.peaks, title="Peaks and limits"
            )
            plain_table(
                ("Axis", "Parameter", "Predicted ± (95 %)"), found.errors, title="Error bars"
            )
        for name, figure in found.figures.items():
            if name in self.pictures:
                self.pictures[name].show(figure)
            else:
                with self.plot:
                    self.pictures[name] = Picture(figure)

    async def _save(self) -> None:
        with failures_said():
            folder = self.window.workbench.settings.runs / "designs"
            path = await self.window.workbench.workers.do(save_design, self.wish, str(folder))
            ui.download.file(path)
            ui.notify(f"Saved as {path}")


_TEST = {"duration": "Duration (s)", "fs": "Rate (Hz)"}
_MODEL = {
    "delay": "Delay (s)",
    "natural_frequency": "Natural frequency (Hz)",
    "damping_ratio": "Damping ratio",
    "noise_std": "Noise (unit)",
    "wanted": "Frequency wanted to ± %",
}
_AXIS = {
    "low": "From (Hz)",
    "high": "To (Hz)",
    "position": "Position limit",
    "velocity": "Velocity limit",
    "acceleration": "Acceleration limit",
    "amplitude": "Amplitude used",
}
_NEEDED = {*_TEST, "unit", "alpha", "rows", "model"}
