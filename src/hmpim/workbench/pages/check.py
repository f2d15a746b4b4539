"""The page that checks: four lights, all of which must be green before a run."""

import asyncio

from nicegui import ui

from hmpim.experiment.readiness import LIGHTS
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import Checked
from hmpim.workbench.pages.frame import Command, card, failures_said
from hmpim.workbench.pages.run import NO_WATCHDOG, rig_choice
from hmpim.workbench.work.design import digest, rough, stimuli_of
from hmpim.workbench.work.driving import Questions

__all__ = ["check"]

_WORDS = {
    "limits": "Limits: every axis stays inside, and can be stopped smoothly",
    "error bars": "Error bars: the run will reach the wanted accuracy",
    "independence": "Independence: the axes can be distinguished",
    "answer": "Answer: the rig follows at 5 % of the amplitude",
}


def check(window: Window) -> None:
    """Make the page."""
    CheckPage(window)


class CheckPage:
    """The page in one window.

    Parameters
    ----------
    window : Window
        Whose it is.
    """

    def __init__(self, window: Window) -> None:
        self.window, self.bench = window, window.workbench.rig
        self.asked: tuple[int, str] | None = None
        with ui.element("div").classes("hm-side hm-screen"), card("Rig"):
            self.choice = rig_choice(window)
            ui.label(
                "The check arms the rig, moves it at 5 % of the amplitude, and disarms it."
            ).classes("hm-soft")
            self.outliving = ui.checkbox(NO_WATCHDOG)
            self.button = ui.button("Check", on_click=self._start)
            self.stop = (
                ui.button("Stop", on_click=lambda: self.bench.stop("stopped by hand"))
                .props("color=negative")
                .classes("hm-stop")
            )
        with ui.element("div").classes("hm-body"), card("Before a run"):
            self.rig = ui.label().classes("hm-on-paper")
            self.verdict = ui.label().classes("hm-verdict").props('role="status"')
            with ui.element("ul").classes("hm-lights"):
                self.lights = {name: self._light(name) for name in LIGHTS}
            ui.link("To the run", f"/run?desk={window.name}").classes("hm-screen")
        self.command = Command(
            "from hmpim.experiment.readiness import limits_light, error_light, ...\n"
            "limits_light(rig, stimuli), error_light(stimuli, model=model, noise_std=0.1, "
            "wanted=0.5),\nindependence_light(stimuli), answer_light(rig, stimuli, play)"
        )
        ui.timer(0.2, self._tick)
        self._tick()

    def _light(self, name: str) -> tuple[ui.icon, ui.label]:
        with ui.element("li").classes("hm-row"):
            icon = ui.icon("radio_button_unchecked", size="1.6rem")
            with ui.element("div"):
                ui.label(_WORDS[name])
                words = ui.label().classes("hm-soft")
        return icon, words

    async def _start(self) -> None:
        desk, name = self.window.desk, self.window.name
        with failures_said():
            stimuli = await self.window.workbench.workers.soon(stimuli_of, desk.wish)
            model = desk.wish.model
            self.bench.arm(name, desk.rig)
            try:
                await asyncio.to_thread(
                    self.bench.start,
                    name,
                    stimuli,
                    outliving=bool(self.outliving.value),
                    questions=Questions(
                        model=rough(model),
                        noise_std=model.noise_std,
                        wanted=0.01 * model.wanted * model.natural_frequency,
                    ),
                )
            except BaseException:
                self.bench.disarm(name)
                raise
            self.asked = (self.bench.count, digest(desk.wish, desk.rig))
            self.window.change(checked=Checked())
        self._tick()

    def _tick(self) -> None:
        self._noted()
        desk, bench = self.window.desk, self.bench
        running = bench.state == "running"
        self.rig.set_text(f"Rig: {desk.rig}")
        mine = self.asked is not None and self.asked[0] == bench.count
        fresh = desk.checked.digest == digest(desk.wish, desk.rig)
        self.button.set_enabled(bool(desk.rig) and bench.state != "running")
        self.choice.set_enabled(not running)
        self.stop.set_enabled(running)
        for name, (icon, words) in self.lights.items():
            light = bench.lights.get(name) if mine else None
            green = light.green if light is not None else (fresh and name in desk.checked.green)
            known = light is not None or (fresh and bool(desk.checked.digest))
            mark = "check_circle" if green else "cancel" if known else "radio_button_unchecked"
            colour = "hm-ok" if green else "hm-bad" if known else "hm-soft"
            icon.set_name(mark)
            icon.classes(replace=colour)
            icon.props(f'aria-label="{"green" if green else "red" if known else "not checked"}"')
            words.set_text(light.words if light is not None else "")
        green = fresh and set(LIGHTS) <= set(desk.checked.green)
        if running:
            said = "Checking …"
        elif green:
            said = "All green: the run may begin."
        elif fresh and desk.checked.digest:
            said = "Not ready: see what is red."
        else:
            said = "Not checked, or changed since."
        fault = bench.ended.fault if mine and bench.ended is not None else ""
        self.verdict.set_text(f"{said} {fault}".strip())
        self.verdict.classes(replace=f"hm-verdict {'hm-ok' if green else 'hm-doubt'}")

    def _noted(self) -> None:
        """Keep the lights of a check that is over, and give the rig back."""
        if self.asked is None or self.bench.ended is None or self.asked[0] != self.bench.count:
            return
        desk = self.window.desk
        if not desk.checked.digest and desk.rig:
            green = tuple(n for n, light in self.bench.lights.items() if light.green)
            self.window.change(checked=Checked(rig=desk.rig, digest=self.asked[1], green=green))
            self.bench.disarm(self.window.name)
