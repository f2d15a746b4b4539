"""A result on the page: verdict, table, pictures, and cursors to read them by eye."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol, get_args

from nicegui import ui

from hmpim.identify import Identification, PairIdentification
from hmpim.identify.section_iv.windows import WindowName
from hmpim.plots import Curve, Figure
from hmpim.plots.by_hand import with_hand_values
from hmpim.report.by_hand import reading_at
from hmpim.report.figures import Picture as Described
from hmpim.report.numbers import how_to_read, typeset
from hmpim.report.words import by_weight, headline, leading, structure_words
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import Analysis
from hmpim.workbench.pages.frame import card, failures_said
from hmpim.workbench.parts.picture import Cursor, Picture
from hmpim.workbench.parts.table import parameter_cells, plain_table
from hmpim.workbench.work.record import Found, Question, View, windowed, write_report

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["Owner", "ResultView"]

_CLASSES = {"ok": "hm-ok", "doubtful": "hm-doubt"}
_WEIGHTS = {"doubt": "hm-doubt", "info": "hm-soft"}
_FEW = 3  # remarks that are shown before a reader asks for more
_BY_HAND = {
    "bandwidth_phase90": "−90° by hand (Hz)",
    "bandwidth_3db": "−3 dB by hand (Hz)",
    "delay": "Delay by hand (s)",
}


class Owner(Protocol):
    """The page on which a result stands."""

    window: Window
    ends: dict[str, ui.number]

    @property
    def wish(self) -> Analysis:
        """What is analysed, and what was set by hand."""

    @property
    def question(self) -> Question:
        """What is asked, of which file."""

    @property
    def path(self) -> "Path":
        """The file."""

    def change(self, **changes: Any) -> None:
        """Change the wish."""

    async def identify(self) -> None:
        """Identify anew."""


class ResultView:
    """What was found, and what is read off it by hand.

    Parameters
    ----------
    owner : Owner
        The page.
    found : Found
        The result and its pictures.
    automatic : Identification or None
        What was found before structure or interval were set by hand; None where neither is.
    """

    def __init__(self, owner: Owner, found: Found, automatic: Identification | None) -> None:
        self.owner, self.found, self.automatic = owner, found, automatic
        self.pair: PairIdentification = found.result.pairs[
            min(owner.wish.pair, len(found.result.pairs) - 1)
        ]
        self.beside: PairIdentification | None = None
        if automatic is not None:
            self.beside = automatic.pairs[min(owner.wish.pair, len(automatic.pairs) - 1)]
        self.described = {picture.key: picture for picture in found.pictures}
        self.pictures: dict[str, Picture] = {}
        self.fields: dict[str, ui.number] = {}
        self._verdict()
        with card("Parameters"):
            self.table = ui.element("div")
        self._hand()
        for picture in sorted(found.pictures, key=lambda p: p.key != "bode"):
            self._picture(picture)
        self._table()

    def _verdict(self) -> None:
        result = self.found.result
        with card("Verdict"):
            classes = _CLASSES.get(str(result.verdict), "hm-bad")
            ui.label(typeset(headline(result))).classes(f"hm-verdict {classes}")
            ui.label(f"Record: {self.owner.wish.file}").classes("hm-on-paper")
            if self.automatic is not None and self.beside is not None:
                ui.label(
                    f"✎ By hand: {self.owner.question.set_by_hand}. Automatic: "
                    f"{structure_words(self.beside.structure)}, whole record: "
                    f"{headline(self.automatic)}"
                )
            self._findings()
            with ui.element("div").classes("hm-row"):
                ui.button("Report", icon="download", on_click=self._report)
                if len(result.pairs) > 1:
                    named = {k: f"{p.output} from {p.input}" for k, p in enumerate(result.pairs)}
                    ui.select(
                        named, label="Pair", value=self.owner.wish.pair, on_change=self._other
                    )

    def _findings(self) -> None:
        """Show what the verdict does not say itself: every doubt, and a few of the remarks."""
        said = leading(self.pair) if len(self.found.result.pairs) == 1 else None
        left = [finding for finding in by_weight(self.pair.warnings) if finding is not said]
        doubts = sum(finding.severity == "doubt" for finding in left)
        shown, more = left[: max(doubts, _FEW)], left[max(doubts, _FEW) :]
        for finding in shown:
            ui.label(typeset(finding.message)).classes(_WEIGHTS[finding.severity])
        if more:
            with ui.element("details").classes("hm-more"):
                with ui.element("summary"):
                    ui.label(f"{len(more)} more")
                for finding in more:
                    ui.label(typeset(finding.message)).classes(_WEIGHTS[finding.severity])

    async def _other(self, event: object) -> None:
        self.owner.change(pair=int(getattr(event, "value", 0)), hand={})
        await self.owner.identify()

    def _hand(self) -> None:
        wish = self.owner.wish
        with card("By hand", printed=False):
            ui.label(
                "Drag the lines in the plots, or type; the automatic values stay in the table."
            ).classes("hm-soft")
            with ui.element("div").classes("hm-row"):
                for name, words in _BY_HAND.items():
                    self.fields[name] = ui.number(
                        words,
                        value=wish.hand.get(name),
                        on_change=lambda e, name=name: self.set(name, e.value),
                    ).props("step=any debounce=300 clearable")
                ui.select(
                    list(get_args(WindowName)),
                    label="Window",
                    value=wish.window,
                    on_change=lambda e: self._through(window=e.value),
                )
                ui.number(
                    "α", value=wish.alpha, min=0.1, max=20, step=0.1,
                    on_change=lambda e: self._through(alpha=e.value),
                ).props("debounce=300")  # fmt: skip
            self.reading = ui.label().props('role="status"')

    def _picture(self, picture: Described) -> None:
        figure = self._figure(picture.key)
        with card(picture.title):
            self.pictures[picture.key] = Picture(
                figure,
                cursors=self._cursors(picture.key),
                on_cursor=self._drop,
                ready=self.found.drawn[picture.key] if figure is picture.figure else None,
            )
            ui.label(picture.caption).classes("hm-soft")

    def _figure(self, key: str) -> Figure:
        figure = self.described[key].figure
        if key == "bode" and self.owner.wish.hand:
            return with_hand_values(figure, self.pair, self.owner.wish.hand)
        return figure

    def _cursors(self, key: str) -> list[Cursor]:
        found, wish = self.pair.parameters, self.owner.wish
        if key == "bode":
            frequency = self.pair.frequency_response.frequency
            middle = float(frequency[frequency.size // 2]) if frequency.size else 1.0
            places = {"bandwidth_phase90": (1, "−90°"), "bandwidth_3db": (0, "−3 dB")}
            return [
                self._cursor(name, label, middle, panel=panel)
                for name, (panel, label) in places.items()
            ]
        if key == "correlation":
            return [self._cursor("delay", "delay", 0.0)]
        if key == "signals" and found is not None:
            time = self.described[key].figure.panels[0].of(Curve)[0].x
            ends = {"start": float(time[0]), "stop": float(time[-1])}
            words = {"start": "from", "stop": "to"}
            return [
                Cursor(name=name, at=getattr(wish, name) or end, label=words[name])
                for name, end in ends.items()
            ]
        return []

    def _cursor(self, name: str, label: str, otherwise: float, *, panel: int = 0) -> Cursor:
        """A line at a parameter's value; where there is none, its label says so."""
        at = self.owner.wish.hand.get(name)
        found = getattr(self.pair.parameters, name)
        if at is None and found is not None:
            at = found.value
        if at is None:
            at, label = otherwise, f"{label}: no value, drag to set"
        return Cursor(name=name, at=at, label=label, panel=panel)

    async def _drop(self, name: str, at: float) -> None:
        if name in ("start", "stop"):
            self.owner.ends[name].set_value(float(f"{at:.6g}"))
            await self.owner.identify()
        else:
            self.fields[name].set_value(float(f"{at:.5g}"))

    def set(self, name: str, value: float | None) -> None:
        """Set a value by hand, or take it back; table and plots follow."""
        hand = {k: v for k, v in self.owner.wish.hand.items() if k != name}
        if value is not None:
            hand[name] = float(value)
        self.owner.change(hand=hand)
        self._table()
        for key in ("bode", "correlation"):
            if key in self.pictures:
                self.pictures[key].show(self._figure(key), cursors=self._cursors(key))
        if value is not None and name != "delay":
            fs = self.found.result.record.fs
            self.reading.set_text(reading_at(self.pair, float(value), fs=fs))

    def _table(self) -> None:
        self.table.clear()
        hand, fitted = self.owner.wish.hand, None if self.beside is None else self.pair
        columns, rows = parameter_cells(
            self.beside or self.pair, hand, fitted=fitted,
            set_by_hand=self.owner.question.set_by_hand,
        )  # fmt: skip
        with self.table:
            plain_table(columns, rows, title="Parameters")
            if reading := how_to_read([row[1] for row in rows]):
                ui.label(reading).classes("hm-soft")

    async def _through(self, **changes: object) -> None:
        if None in changes.values():
            return
        self.owner.change(**changes)
        await self.see_through()

    async def see_through(self) -> None:
        """Do the paper's steps through the chosen window; its column and spectra follow."""
        wish = self.owner.wish
        with failures_said():
            seen = await self.owner.window.workbench.workers.do(
                windowed,
                self.owner.question,
                View(window=wish.window, alpha=wish.alpha),
                self.pair,
            )
            if self.table.is_deleted:
                return
            self.pair = replace(self.pair, paper=seen.estimates)
            self._table()
            if "spectra" in self.pictures:
                self.pictures["spectra"].show(seen.spectra)

    async def _report(self) -> None:
        with failures_said():
            page = self.owner.path.with_name(f"{self.owner.path.stem}.report.html")
            wish = self.owner.wish
            await self.owner.window.workbench.workers.do(
                write_report, self.owner.question, str(page), wish.pair, wish.hand, self.beside
            )
            ui.download.file(page)
