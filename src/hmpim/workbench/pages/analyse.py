"""The page that analyses a file: dropped, channels chosen, identified, read by eye."""

import asyncio
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

from nicegui import events, ui

from hmpim.errors import ArgumentError
from hmpim.identify import Identification
from hmpim.model.dynamics import STRUCTURES
from hmpim.record import INTERSAMPLE_WORDS
from hmpim.report.words import structure_words
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import Analysis
from hmpim.workbench.names import free_place
from hmpim.workbench.pages.frame import Command, Later, card, failures_said
from hmpim.workbench.pages.result import ResultView
from hmpim.workbench.work.record import Looked, Question, View, automatic, found, look

__all__ = ["analyse"]

_BETWEEN: dict[str, str] = {
    "auto": "found from the record",
    **{str(name): words for name, words in INTERSAMPLE_WORDS.items()},
}


def analyse(window: Window) -> Later:
    """Make the page."""
    return AnalysePage(window).open


class AnalysePage:
    """The page in one window: its wishes are on the desk, its result is made again from them.

    Parameters
    ----------
    window : Window
        Whose it is.
    """

    def __init__(self, window: Window) -> None:
        self.window = window
        self.workers = window.workbench.workers
        self.looked: Looked | None = None
        self.result: ResultView | None = None
        self.automatic: tuple[tuple[Question, int], Identification] | None = None
        self.asked = 0  # so often; what comes back of an earlier asking is of no use any more
        with ui.element("div").classes("hm-side hm-screen"):
            with card("Record"):
                self._uploader()
                self.files = ui.select(
                    self._known_files(),
                    label="File in the folder of the runs",
                    value=self.wish.file or None,
                    with_input=True,
                    on_change=lambda e: self._take(e.value),
                ).props("clearable")
            self.choices = ui.element("div").classes("hm-side")
        with ui.element("div").classes("hm-body"):
            self.shown = ui.element("div").classes("hm-body").props('aria-live="polite"')
        if not self.wish.file:
            with self.shown, card("Begin"):
                ui.label("Drop a record, or choose one from the folder, to identify it.")
                ui.link("To make one, design a test first.", f"/design?desk={window.name}")
        self.command = Command()

    @property
    def wish(self) -> Analysis:
        """What is to be analysed."""
        return self.window.desk.analysis

    def change(self, **changes: Any) -> None:
        """Change what is to be analysed, and say how Python does it."""
        self.window.change(analysis=replace(self.wish, **changes))
        self.command.show(_command(self.wish))

    async def open(self) -> None:
        """Show what was there when the page was left."""
        if self.wish.file:
            await self._looked()
            if self.wish.inputs and self.wish.outputs and not self.shown.is_deleted:
                await self.identify()

    def _known_files(self) -> list[str]:
        root = self.window.workbench.settings.runs
        files = [p for p in root.rglob("*") if p.is_file() and ".workbench" not in p.parts]
        names = sorted(
            str(p.relative_to(root)) for p in files if p.suffix not in (".html", ".json")
        )
        if self.wish.file and self.wish.file not in names:
            names.append(self.wish.file)
        return names[:2000]

    def _uploader(self) -> None:
        largest = self.window.workbench.settings.largest

        async def uploaded(event: events.UploadEventArguments) -> None:
            with failures_said():
                place = free_place(self.window.workbench.settings.uploads, event.file.name)
                await event.file.save(place)
                name = str(place.relative_to(self.window.workbench.settings.runs))
                self.files.set_options(sorted([*self.files.options, name]))
                self.files.set_value(name)
            dropped.reset()  # what is read stands in the list of files

        def refused() -> None:
            ui.notify(
                f"The file is not taken: it has more than {largest / 1e6:g} MB, or did not arrive",
                type="negative",
            )

        dropped = ui.upload(
            label="Drop a file of any format here",
            auto_upload=True,
            max_file_size=largest,
            on_upload=uploaded,
            on_rejected=refused,
        )
        dropped.props('flat aria-label="Drop a file of any format"').on("failed", refused)

    async def _take(self, file: str | None) -> None:
        if not file or file == self.wish.file:
            return
        self.change(
            file=file, inputs=(), outputs=(), fs=None, start=None, stop=None, pair=0, hand={},
            reference=None,
        )  # fmt: skip
        self.result = None
        self.asked += 1
        self.shown.clear()
        with failures_said():
            await self._looked()

    @property
    def path(self) -> Path:
        """The file, inside the folder of the runs."""
        root = self.window.workbench.settings.runs.resolve()
        path = (root / self.wish.file).resolve()
        if not path.is_relative_to(root):
            raise ArgumentError(f"{self.wish.file!r} is not in the folder of the runs")
        return path

    async def _looked(self) -> None:
        self.choices.clear()
        with self.choices, ui.row().classes("hm-row"):
            ui.spinner()
            ui.label("Reading …")
        try:
            self.looked = await self.workers.do(look, str(self.path))
        finally:
            if not self.choices.is_deleted:
                self.choices.clear()
        if self.choices.is_deleted:
            return
        if not self.wish.inputs and not self.wish.outputs:
            self.change(inputs=self.looked.inputs, outputs=self.looked.outputs)
        with self.choices:
            self._choices(self.looked)
        self.command.show(_command(self.wish))

    def _choices(self, looked: Looked) -> None:
        named = {
            name: f"{name} ({note})" if note else name
            for name, note in zip(looked.names, looked.notes, strict=True)
        }
        with card("Channels"):
            if not looked.inputs or not looked.outputs:
                ui.label("No input and output stand out; choose them.").classes("hm-doubt")
                for words in looked.reasons:
                    ui.label(words).classes("hm-soft")
            for field, words in (("inputs", "Inputs"), ("outputs", "Outputs")):
                ui.select(
                    named,
                    label=words,
                    multiple=True,
                    value=[n for n in getattr(self.wish, field) if n in named],
                    on_change=lambda e, field=field: self.change(**{field: tuple(e.value)}),
                ).props("use-chips")
            if looked.fs is None:
                ui.number(
                    "Rate (Hz); the file has no time",
                    value=self.wish.fs,
                    min=0,
                    on_change=lambda e: self.change(fs=e.value),
                )
            with ui.element("div").classes("hm-row"):
                self.ends = {
                    name: ui.number(
                        words,
                        value=getattr(self.wish, name),
                        on_change=lambda e, name=name: self.change(**{name: e.value}),
                    ).props("step=any")
                    for name, words in (("start", "From (s)"), ("stop", "To (s)"))
                }
            known: dict[str, str] = {"": "any"}
            known |= {str(name): structure_words(name) for name in STRUCTURES}
            ui.select(
                known,
                label="Structure",
                value=self.wish.structure or "",
                on_change=lambda e: self.change(structure=e.value or None),
            )
            ui.select(
                _BETWEEN,
                label="Input between its samples",
                value=self.wish.intersample,
                on_change=lambda e: self.change(intersample=e.value),
            )
            ui.select(
                {"": "none", **named},
                label="Command of the loop (reference)",
                value=self.wish.reference if self.wish.reference in named else "",
                on_change=lambda e: self.change(reference=e.value or None),
            )
            self.button = ui.button("Identify", on_click=self.identify)

    async def identify(self) -> None:
        """Identify what is chosen, and show it."""
        wish = self.wish
        with failures_said():
            if not wish.inputs or not wish.outputs:
                raise ArgumentError("choose at least one input and one output")
            question, button = self.question, self.button
            self.asked += 1
            asked = self.asked
            button.disable()
            self.shown.clear()
            with self.shown, ui.row().classes("hm-row"):
                ui.spinner()
                ui.label("Identifying …")
            try:
                made, beside = await asyncio.gather(
                    self.workers.do(found, question, View(pair=wish.pair)), self._beside(question)
                )
            finally:
                if asked == self.asked and not self.shown.is_deleted:  # else the page was left
                    self.shown.clear()
                if not button.is_deleted:  # another file has another one
                    button.enable()
            if asked != self.asked or self.shown.is_deleted:
                return
            if beside is None:
                self.automatic = ((question.automatic, made.stamp), made.result)
            with self.shown:
                self.result = ResultView(self, made, beside)
            if (wish.window, wish.alpha) != ("gaussian", 1.5):
                await self.result.see_through()

    async def _beside(self, question: Question) -> Identification | None:
        """What is found with nothing set by hand, to stand beside; None where nothing is set.

        It is kept as long as file and channels are the same.
        """
        if not question.set_by_hand:
            return None
        asked = (question.automatic, self.path.stat().st_mtime_ns)
        if self.automatic is None or self.automatic[0] != asked:
            self.automatic = (asked, await self.workers.do(automatic, question))
        return self.automatic[1]

    @property
    def question(self) -> Question:
        """What is asked, of which file."""
        wish = self.wish
        return Question(
            file=str(self.path),
            inputs=wish.inputs,
            outputs=wish.outputs,
            fs=wish.fs,
            start=wish.start,
            stop=wish.stop,
            structure=wish.structure,
            intersample=wish.intersample,
            reference=wish.reference,
        )


def _command(wish: Analysis) -> str:
    words = ["hmpim", "identify", wish.file]
    for name in wish.inputs:
        words += ["--input", name]
    for name in wish.outputs:
        words += ["--output", name]
    for option, value in (("--fs", wish.fs), ("--from", wish.start), ("--to", wish.stop)):
        if value is not None:
            words += [option, f"{value:g}"]
    if wish.structure is not None:
        words += ["--structure", wish.structure]
    if wish.intersample != "auto":
        words += ["--intersample", wish.intersample]
    if wish.reference is not None:
        words += ["--reference", wish.reference]
    for name, value in wish.hand.items():
        words += ["--hand", f"{name}={value:.6g}"]
    return shlex.join([*words, "--report", f"{Path(wish.file).stem}.report.html"])
