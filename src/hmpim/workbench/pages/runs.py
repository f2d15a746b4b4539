"""The page of the runs: a table of the folder, comparison, trend, specification."""

import shlex

from nicegui import ui

from hmpim.report.words import GLOSSARY
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import Analysis
from hmpim.workbench.pages.frame import Command, Later, card, failures_said
from hmpim.workbench.parts.picture import Picture
from hmpim.workbench.parts.table import VERDICT_CLASSES, plain_table
from hmpim.workbench.work.runs import Listed, Row, compared, listed

__all__ = ["runs"]

_HEADS = ("Choose", "Run", "Date", "Channels", "Rate, length", "Verdict", "Specification", "")


def runs(window: Window) -> Later:
    """Make the page."""
    return RunsPage(window).look


class RunsPage:
    """The page in one window.

    Parameters
    ----------
    window : Window
        Whose it is.
    """

    def __init__(self, window: Window) -> None:
        self.window = window
        self.folder = str(window.workbench.settings.runs)
        with ui.element("div").classes("hm-side hm-screen"):
            with card("Which runs"):
                self.where = ui.input("Only those with", placeholder="name = *roll*, delay < 3ms")
                self.wanted = ui.input("Specification", placeholder="bandwidth_phase90 > 9.12")
                ui.button("Read the folder again", on_click=self.look)
            with card("Compare"):
                self.parameter = ui.select(
                    {w.name: w.label for w in GLOSSARY},
                    label="From run to run",
                    value="bandwidth_phase90",
                )
                self.pair = ui.input("Pair", placeholder="roll.position from roll.command")
                self.button = ui.button("Compare those chosen", on_click=self._compare)
        with ui.element("div").classes("hm-body"):
            with card("Runs"):
                self.table = ui.element("div")
                with self.table:
                    ui.label("Reading …").classes("hm-soft")
            self.shown = ui.element("div").classes("hm-body").props('aria-live="polite"')
        self.command = Command()

    async def look(self) -> None:
        """Read the folder, and show what is in it."""
        with failures_said():
            found = await self.window.workbench.workers.do(
                listed, self.folder, self.where.value or "", self.wanted.value or ""
            )
            if not self.table.is_deleted:
                self._show(found)

    def _show(self, found: Listed) -> None:
        words = ["hmpim", "runs", self.folder]
        for text in (self.where.value or "").split(","):
            words += ["--where", text.strip()] if text.strip() else []
        self.command.show(shlex.join([*words, "--compare"]))
        self.table.clear()
        with self.table:
            if not found.rows:
                filtered = (
                    "No run meets this condition." if (self.where.value or "").strip() else ""
                )
                ui.label(filtered or "There are no runs yet.").classes("hm-soft")
                return
            whole = ui.element("div").classes("hm-table hm-runs")
            whole.props('tabindex=0 role="region" aria-label="Runs of the folder"')
            with whole, ui.element("table"):
                with ui.element("thead"), ui.element("tr"):
                    for head in _HEADS:
                        with ui.element("th").props('scope="col"'):
                            ui.label(head)
                with ui.element("tbody"):
                    for row in found.rows:
                        self._row(row)
            for name, why in found.unreadable:
                ui.label(f"{name} cannot be read: {why}").classes("hm-bad")

    def _row(self, row: Row) -> None:
        def choose(on: bool) -> None:
            others = [n for n in self.window.desk.chosen_runs if n != row.name]
            self.window.change(chosen_runs=(*others, *([row.name] if on else [])))

        def analyse() -> None:
            self.window.change(analysis=Analysis(file=row.file))
            ui.navigate.to(f"/analyse?desk={self.window.name}")

        with ui.element("tr"):
            with ui.element("td"):
                ui.checkbox(
                    value=row.name in self.window.desk.chosen_runs,
                    on_change=lambda e: choose(bool(e.value)),
                ).props["aria-label"] = f"Choose {row.name}"
            for cell in (row.name, row.date, row.channels, row.length, row.verdict, row.met):
                with ui.element("td"):
                    ui.label(cell).classes(VERDICT_CLASSES.get(cell, ""))
            with ui.element("td"):
                if row.file:
                    ui.button("Analyse", on_click=analyse).props("flat dense")

    async def _compare(self) -> None:
        with failures_said():
            self.button.disable()
            self.shown.clear()
            with self.shown, ui.row().classes("hm-row"):
                ui.spinner()
                ui.label("Comparing; runs without a result are identified first …")
            try:
                found = await self.window.workbench.workers.do(
                    compared,
                    self.folder,
                    self.window.desk.chosen_runs,
                    str(self.parameter.value),
                    self.pair.value or "",
                    self.wanted.value or "",
                )
            finally:
                if not self.shown.is_deleted:
                    self.shown.clear()
                if not self.button.is_deleted:
                    self.button.enable()
            if self.shown.is_deleted:
                return
            with self.shown:
                with card("Bode plots over each other"):
                    Picture(found.bode)
                with card("From run to run"):
                    Picture(found.trend)
                with card("Parameters"):
                    plain_table(found.columns, found.cells, title="Parameters of the runs")
        await self.look()  # verdicts are known now
