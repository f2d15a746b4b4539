"""The page that designs: what is wished, sliders, and all that follows from them."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any

from nicegui import background_tasks, ui

from hmpim.errors import HmpimError
from hmpim.plots import Figure
from hmpim.plots.stimulus import stimulus_spectrogram
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import AxisRow, Wish
from hmpim.workbench.pages.frame import Command, Later, card, failures_said
from hmpim.workbench.parts.picture import Picture
from hmpim.workbench.parts.slider import Slider, Words
from hmpim.workbench.parts.table import plain_table
from hmpim.workbench.work.design import stimulus_part
from hmpim.workbench.work.designed import (
    Designed,
    designed,
    error_cells,
    five_axes,
    save_design,
    spectrum,
)
from hmpim.workbench.workers import Latest

__all__ = ["design"]

_SPECTRUM_EVERY = 0.3  # s between two spectra while a slider moves faster than all can follow
_MANY = 1_000_000  # samples of a design that takes long: about a second
_LONG = 0.5  # s after which a design that is not there yet is spoken of
_REST = 0.3  # s without a change after which tables and spectrogram follow


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
        self.sliders: dict[str, Slider] = {}
        # what is shown: the design, and of which wishes motion, spectrum and spectrogram are
        self.found: Designed | None = None
        self.moved: tuple[Wish, int] | None = None
        self.windowed: tuple[Wish, int, float] | None = None
        self.spectrogram_of: tuple[Wish, int] | None = None
        self.spectrum_at = 0.0
        self.resting: asyncio.Task[None] | None = None
        with ui.element("div").classes("hm-side hm-screen"):
            with card("Sliders"):
                self._sliders()
                ui.label(_RESTING).classes("hm-soft")
                with ui.element("div").classes("hm-row"):
                    ui.button("Solve", on_click=self._solve).tooltip(
                        "The largest motion and the smallest extinction inside the limits"
                    )
                    ui.button("Gentlest", on_click=self._gentlest).tooltip(
                        "The smallest peak acceleration that still gives the accuracy wanted"
                    )
            with card("Test"):
                self._numbers(self.wish, self._set, _TEST)
                ui.input("Unit", value=self.wish.unit, on_change=lambda e: self._set(unit=e.value))
            self.rows = ui.element("div").classes("hm-side")
            with card("Rough model of the unit"):
                self._numbers(self.wish.model, self._model, _MODEL)
        with ui.element("div").classes("hm-body"):
            with card("Design"):
                self.said = Words()
                self.bands = ui.label().classes("hm-on-paper")
                self.tables = ui.element("div").classes("hm-body")
                with ui.element("div").classes("hm-row"):
                    ui.button("Save and download", icon="download", on_click=self._save)
            with card("Pictures"):
                self.axis = ui.select({0: ""}, label="Axis", value=0, on_change=self.draw)
                self.axis.classes("hm-screen")
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
        wish = replace(self.wish, **changes)
        if wish == self.wish:
            return None  # a key on a slider tells its value twice
        self.window.change(wish=wish)
        return self.draw()

    async def _solve(self) -> None:
        """As large as the limits allow, and as even as they do."""
        rows = tuple(replace(row, amplitude=row.position) for row in self.wish.rows)
        self.window.change(
            wish=replace(self.wish, rows=rows, gentlest=False, extinction=None, lead=None)
        )
        await self._anew()

    async def _gentlest(self) -> None:
        self.window.change(wish=replace(self.wish, gentlest=True, extinction=None, lead=None))
        await self._anew()

    async def _anew(self) -> None:
        """Show a wish that no slider made."""
        row = self.wish.rows[0]
        values = {"amplitude": row.amplitude / row.position, "extinction": 0.0, "lead": 0.0}
        for name, value in values.items():
            self.sliders[name].stand(round(value, 2))
            self.sliders[name].say(f"{value:g}")
        self._axes()
        await self.draw()

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
        self._slider(
            "amplitude", "Amplitude, share of the limit", (0.01, 1.0), row.amplitude / row.position
        )
        self._slider(
            "extinction", "Extinction n (0: solved)", (0.0, 3.0),
            self.wish.extinction or 0.0,
        )  # fmt: skip
        self._slider("lead", "Lead, s (0: solved)", (0.0, 2.0), self.wish.lead or 0.0)
        self._slider("alpha", "Window α", (0.1, 5.0), self.wish.alpha)

    def _slider(self, name: str, words: str, ends: tuple[float, float], value: float) -> None:
        self.sliders[name] = Slider(
            words, ends=ends, step=0.01, value=round(value, 2),
            on_slide=lambda value: self._slid(name, value),
        )  # fmt: skip

    def _slid(self, name: str, value: float) -> Any:
        if name == "alpha":
            return self._set(alpha=value)
        if name == "amplitude":
            rows = tuple(replace(r, amplitude=value * r.position) for r in self.wish.rows)
            return self._set(rows=rows, gentlest=self.wish.gentlest)
        return self._set(**{name: value or None}, gentlest=False)

    def _axes(self) -> None:
        self._name_axes()
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

    def _name_axes(self) -> None:
        """Offer the axes there are to be drawn; nothing to choose where there is one."""
        names = {k: row.name or f"axis {k + 1}" for k, row in enumerate(self.wish.rows)}
        chosen = self.axis.value if self.axis.value in names else 0
        self.axis.set_options(names, value=chosen)
        self.axis.set_visibility(len(names) > 1)

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
        """Show what follows from the wish: what has changed, and first what moves the plots."""
        wish, axis, soon = self.wish, int(self.axis.value or 0), self._soon
        if self.resting is not None:
            self.resting.cancel()
        moved = (stimulus_part(wish), axis)
        if wish.gentlest and moved != self.moved:
            self.said.say("Searching for the gentlest …", "soft")
        try:
            if moved != self.moved:
                self.moved, self.windowed = None, None
                made = await self._patiently(soon(designed, wish, axis))
                self.found = made
                if self.said.is_deleted:  # the page was left meanwhile
                    return
                self._picture("motion", made.motion)
                self.moved = moved
            windowed = (*moved, wish.alpha)
            late = time.monotonic() - self.spectrum_at > _SPECTRUM_EVERY
            if windowed != self.windowed and (late or not self.latest.newer):
                figure = await soon(spectrum, wish, axis)
                if self.said.is_deleted:
                    return
                self._picture("spectrum", figure)
                self.windowed, self.spectrum_at = windowed, time.monotonic()
            if self.found is not None:
                self._say(self.found)
            if not self.latest.newer:
                self.resting = background_tasks.create(self._rest(wish, moved))
        except HmpimError as error:
            self.moved = None
            self._refuse(error)

    @property
    def _soon(self) -> Callable[..., Coroutine[Any, Any, Any]]:
        """Where this design is worked on: a long one not where other windows wait for theirs."""
        workers, wish = self.window.workbench.workers, self.wish
        samples = len(wish.rows) * wish.duration * wish.fs
        return workers.soon if samples < _MANY else workers.do

    async def _patiently(self, made: Coroutine[Any, Any, Designed]) -> Designed:
        """What is made; where that takes long, the page says so meanwhile."""
        task = asyncio.ensure_future(made)
        await asyncio.wait({task}, timeout=_LONG)
        if not task.done() and not self.wish.gentlest and not self.said.is_deleted:
            self.said.say("Designing …", "soft")
        return await task

    def _refuse(self, error: HmpimError) -> None:
        if not self.said.is_deleted:
            self.said.say(" ".join(str(error).split()), "bad")

    async def _rest(self, wish: Wish, moved: tuple[Wish, int]) -> None:
        """Show, once the sliders rest, what no hand on a slider waits for."""
        await asyncio.sleep(_REST)
        workers, found = self.window.workbench.workers, self.found
        if found is None or self.said.is_deleted:
            return
        try:
            errors = await self._soon(error_cells, wish)
            if self.tables.is_deleted:
                return
            self._tabulate(found, errors)
            self.command.show(found.command)
            if moved != self.spectrogram_of:
                figure = await workers.do(stimulus_spectrogram, found.shown)
                if not self.said.is_deleted:
                    self.spectrogram_of = moved
                    self._picture("spectrogram", figure)
        except HmpimError as error:
            self._refuse(error)

    def _tabulate(self, found: Designed, errors: tuple[tuple[str, ...], ...]) -> None:
        bands = (f"{row.name} {row.low:g} to {row.high:g} Hz".strip() for row in self.wish.rows)
        self.bands.set_text(f"Swept: {'; '.join(bands)}")
        self.tables.clear()
        with self.tables:
            heads = ("Axis", "Quantity", "Peak", "Limit", "Unit")
            plain_table(heads, found.peaks, title="Peaks and limits")
            plain_table(("Axis", "Parameter", "Predicted ± (95 %)"), errors, title="Error bars")

    def _say(self, found: Designed) -> None:
        for name, slider in self.sliders.items():
            solved = found.solved.get(name)
            slider.say(f"{slider.value:g}" if solved is None else f"solved: {solved:.3g}")
        self.said.say(found.words, "ok" if found.inside else "bad")

    def _picture(self, name: str, figure: Figure) -> None:
        if name in self.pictures:
            self.pictures[name].show(figure)
        else:
            with self.plot:
                self.pictures[name] = Picture(figure)

    async def _save(self) -> None:
        with failures_said():
            folder = self.window.workbench.settings.runs / "designs"
            path = await self._soon(save_design, self.wish, str(folder))
            ui.download.file(path)
            ui.notify(f"Saved as {path}")


_RESTING = "Curves follow a slider at once; tables, error bars and spectrogram once it rests."
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
