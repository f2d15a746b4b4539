"""The page that runs: arm a rig, start, watch, stop."""

import asyncio
from contextlib import suppress

from nicegui import events, ui

from hmpim.errors import HmpimError, RigError
from hmpim.identify import Look
from hmpim.plots import Figure
from hmpim.plots.closing import closing_bars
from hmpim.report.words import structure_words
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import Analysis
from hmpim.workbench.pages.frame import Command, card, failures_said
from hmpim.workbench.parts.picture import Picture
from hmpim.workbench.parts.strip import Strip
from hmpim.workbench.parts.table import look_cells, plain_table
from hmpim.workbench.rig import known_rigs
from hmpim.workbench.work.design import digest, stimuli_of
from hmpim.workbench.work.record import response_so_far

__all__ = ["ready_to_run", "run"]

NO_WATCHDOG = "Rig without a watchdog: drive it from a separate process"
_EVERY = 0.1  # s between two looks at what has come in
_FEWEST = 200  # samples before the first estimate


def run(window: Window) -> None:
    """Make the page."""
    RunPage(window)


def ready_to_run(window: Window) -> str:
    """Say why the design may not be run on the rig; '' where every light is green."""
    from hmpim.experiment.readiness import LIGHTS

    desk = window.desk
    if not desk.rig:
        return "Choose a rig."
    if desk.checked.digest != digest(desk.wish, desk.rig):
        return "The design or the rig has changed since the last check: make a new check."
    left = [name for name in LIGHTS if name not in desk.checked.green]
    return f"Not green in the check: {', '.join(left)}." if left else ""


class RunPage:
    """The page in one window.

    Parameters
    ----------
    window : Window
        Whose it is.
    """

    def __init__(self, window: Window) -> None:
        self.window, self.bench = window, window.workbench.rig
        self.strips: dict[str, Strip] = {}
        self.shown = -1
        self.pictures: dict[str, Picture] = {}
        self.measuring = False
        self.measured: tuple[str, int] = ("", -1)  # axis and samples of the last response
        self.looked: tuple[str, float] = ("", -1.0)  # axis and time of the last look
        with ui.element("div").classes("hm-side"):
            with card("Rig", printed=False):
                self.choice = rig_choice(window)
                self.state = (
                    ui.label().props('role="status" aria-live="polite"').classes("hm-verdict")
                )
                with ui.element("div").classes("hm-row"):
                    self.arm = ui.button("Arm", on_click=self._arm)
                    self.start = ui.button("Start", on_click=self._start).props("color=positive")
                self.outliving = ui.checkbox(NO_WATCHDOG)
                self.why = ui.label().classes("hm-soft")
                self.stop = (
                    ui.button("Stop", on_click=lambda: self.bench.stop("stopped by hand"))
                    .props('color=negative aria-keyshortcuts="Escape"')
                    .classes("hm-stop")
                )
                ui.label("The Escape key stops too.").classes("hm-soft")
            with card("Estimate so far"):
                self.axis = ui.select([], label="Axis", on_change=self._anew)
                self.axis.props("dense").classes("hm-screen")
                self.read_so_far = ui.label().classes("hm-soft")
                self.estimates = ui.element("div").classes("hm-shown")
            with card("Log"):
                self.log = ui.label().classes("hm-pre hm-shown")
                self.log.props('tabindex=0 role="log" aria-label="The last lines of the log"')
        with ui.element("div").classes("hm-body"):
            with card("Command and response"):
                self.progress = ui.label("Nothing is running.").classes("hm-soft")
                self.chart = ui.element("div").classes("hm-shown")
            with card("Error bar, closing in on what was asked"):
                self.bars = ui.element("div").classes("hm-later")
            with card("Bode plot so far"):
                self.plot = ui.element("div").classes("hm-later")
            self.after = ui.element("div").classes("hm-body")
        self.command = Command(_command(window))
        ui.keyboard(on_key=self._key, ignore=[])
        ui.timer(_EVERY, self._tick)
        ui.timer(0.5, self._look)
        ui.timer(2.0, self._measure)
        ui.timer(0.5, lambda: self.log.set_text("\n".join(self.bench.lines)))
        self._tick()

    def _key(self, event: events.KeyEventArguments) -> None:
        if event.key.escape and event.action.keydown:
            self.bench.stop("stopped by hand")

    def _arm(self) -> None:
        with failures_said():
            if self.bench.owner == self.window.name:
                self.bench.disarm(self.window.name)
            else:
                self.bench.arm(self.window.name, self.window.desk.rig)
        self._tick()

    async def _start(self) -> None:
        with failures_said():
            reason = ready_to_run(self.window)
            if reason:
                raise RigError(reason)
            stimuli = await self.window.workbench.workers.soon(stimuli_of, self.window.desk.wish)
            outliving = bool(self.outliving.value)
            await asyncio.to_thread(
                self.bench.start, self.window.name, stimuli, outliving=outliving
            )
        self._tick()

    def _tick(self) -> None:
        """Show what is so now; everything is read off the bench, so any window may come late."""
        bench, mine = self.bench, self.bench.owner == self.window.name
        bench.release()
        words = {
            "idle": "Not armed",
            "armed": f"Armed: {bench.rig}" if mine else f"Armed by another window: {bench.rig}",
            "running": f"{'Checking' if bench.checking else 'Running'}: {bench.rig}",
        }
        state = bench.state
        self.state.set_text(words[state])
        self.state.classes(replace=f"hm-verdict {'hm-doubt' if state != 'idle' else ''}")
        why = ready_to_run(self.window)
        self.why.set_text(why)
        self.arm.set_text("Disarm" if mine else "Arm")
        self.arm.set_enabled(state == "idle" or (state == "armed" and mine))
        self.choice.set_enabled(state == "idle")
        self.start.set_enabled(state == "armed" and mine and not why)
        self.stop.set_enabled(state == "running")
        self._follow()

    def _follow(self) -> None:
        live, bench = self.bench.live, self.bench
        if bench.count != self.shown or (live.channels and not self.strips):
            self.shown = bench.count
            self._anew()
            self.strips = {}
            self.chart.clear()
            self.after.clear()
            with self.chart:
                for axis in live.axes:
                    self.strips[axis] = Strip(live, axis, limit=live.limits.get(axis))
            axes = list(live.axes)
            self.axis.set_options(
                {a: a or "the only one" for a in axes}, value=axes[0] if axes else None
            )
        for strip in self.strips.values():
            strip.follow(live)
        if live.seconds:
            self.progress.set_text(f"{live.end:.1f} of {live.seconds:.1f} s")
        if bench.ended is not None and not list(self.after):
            self._ended()

    def _anew(self) -> None:
        """Take away what was shown of another run or axis until this one's is there."""
        self.read_so_far.set_text("")
        self.measured, self.looked = ("", -1), ("", -1.0)
        self.pictures.clear()
        for place in (self.estimates, self.bars, self.plot):
            place.clear()

    def _ended(self) -> None:
        ended, folder = self.bench.ended, self.bench.folder
        if ended is None or folder is None or self.bench.checking:
            return
        with self.after, card("The run is over"):
            if ended.fault:
                ui.label(ended.fault).classes("hm-bad hm-verdict")
            elif ended.reason:
                ui.label(f"Ended early: {ended.reason}.").classes("hm-doubt hm-verdict")
            else:
                ui.label("Played to the end.").classes("hm-ok hm-verdict")
            if ended.kept:
                name = str((folder / "run.h5").relative_to(self.window.workbench.settings.runs))
                ui.label(f"Record: {name}")

                def analyse() -> None:
                    self.window.change(analysis=Analysis(file=name))
                    ui.navigate.to(f"/analyse?desk={self.window.name}")

                ui.button("Analyse it", on_click=analyse).style("align-self: flex-start")

    async def _look(self) -> None:
        """Look at the estimate so far, with all that has come in."""
        live, axis = self.bench.live, self.axis.value
        if axis is None or self.bench.checking or len(live.of(axis)) < 2:
            return
        looks, count = self.bench.looks(axis), self.bench.count
        if looks is None:
            self.read_so_far.set_text(
                "The stimulus has no band: nothing is estimated until it is played."
            )
            return
        with suppress(HmpimError):  # the samples cannot be put on one clock yet
            await looks.follow(live, axis, self.window.workbench.workers.do)
        look = looks.look
        left = self.axis.value != axis or self.bench.count != count
        if look is None or self.estimates.is_deleted or left:
            return
        if (axis, look.time) == self.looked:
            return
        self.looked = (axis, look.time)
        self.read_so_far.set_text(
            _of_look(look, "" if looks.passed else f"{looks.passed_at:.1f} s")
        )
        self.estimates.clear()
        with self.estimates:
            unit = live.of(axis)["output"].unit
            plain_table(*look_cells(look, passed=looks.passed, unit=unit), title="Estimate so far")
        if looks.closing:
            figure = closing_bars(
                [time for time, _ in looks.closing],
                [error for _, error in looks.closing],
                wanted=self.window.desk.wish.model.wanted,
                name="Natural frequency",
            )
            self._show("bars", self.bars, figure)

    async def _measure(self) -> None:
        """Draw the response measured so far; the next begins when this one is done."""
        live, axis = self.bench.live, self.axis.value
        channels = live.of(axis) if axis is not None else {}
        if self.measuring or self.bench.checking or len(channels) < 2:
            return
        command, response = channels["input"], channels["output"]
        size = min(command.size, response.size)
        if size < _FEWEST or (axis, size) == self.measured:
            return
        self.measured, count = (axis, size), self.bench.count
        self.measuring = True
        try:
            looks = self.bench.looks(axis)
            figure = await self.window.workbench.workers.do(
                response_so_far,
                (command.time.copy(), command.values.copy()),
                (response.time.copy(), response.values.copy()),
                (command.name, response.name),
                (command.unit, response.unit),
                None if looks is None else looks.estimator.statistics.band,
            )
            same = self.bench.count == count and self.axis.value == axis
            if same and not self.plot.is_deleted:
                self._show("bode", self.plot, figure)
        except HmpimError:
            await asyncio.sleep(0.3)  # too little yet
        finally:
            self.measuring = False

    def _show(self, name: str, place: ui.element, figure: Figure) -> None:
        if name in self.pictures:
            self.pictures[name].show(figure)
        else:
            with place:
                self.pictures[name] = Picture(figure)


def _of_look(look: Look, passed_at: str) -> str:
    words = f"{look.time:.1f} s read, fitted as {structure_words(look.structure)}."
    if passed_at:
        words += f" The whole band is played at {passed_at}."
    if look.parameters.delay is not None and look.parameters.delay.verdict != "ok":
        words += (
            " Doubtful: the residual still follows the input, or what it says lies "
            "outside of what was played."
        )
    return words


def rig_choice(window: Window) -> ui.select:
    """Choose one of the rigs there are; no other can be typed."""
    known = known_rigs(window.workbench.settings)
    value = window.desk.rig if window.desk.rig in known else None
    return ui.select(
        known,
        label="Rig",
        value=value,
        on_change=lambda e: window.change(rig=e.value or ""),
    )


def _command(window: Window) -> str:
    desk = window.desk
    rig = desk.rig or "RIG"
    return (
        f"hmpim run --rig {rig} design.csv -o run.h5 --report run.html\n\n"
        "record = hmpim.run(rig, stimuli, path='run.h5')"
    )
