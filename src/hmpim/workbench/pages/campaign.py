"""The page that runs a campaign: edit the plan, start, watch, resume."""

from dataclasses import replace
from typing import Any

from nicegui import ui

from hmpim.campaign.shipped import PLANS, shipped_plan
from hmpim.workbench.bench import Window
from hmpim.workbench.desks import Campaign
from hmpim.workbench.pages.frame import Command, card, failures_said
from hmpim.workbench.work.conducting import Done, checked_plan

__all__ = ["campaign"]


def campaign(window: Window) -> None:
    """Make the page."""
    CampaignPage(window)


class CampaignPage:
    """The page in one window.

    Parameters
    ----------
    window : Window
        Whose it is.
    """

    def __init__(self, window: Window) -> None:
        self.window, self.campaigns = window, window.workbench.campaigns
        self.shown: object = None
        self.replaced = ""  # an edited plan that a built-in one was put in place of
        if not self.wish.plan:
            window.change(campaign=replace(self.wish, plan=_shipped("example")))
        with ui.element("div").classes("hm-side"):
            with card("Campaign"):
                ui.input(
                    "Folder, inside that of the runs",
                    value=self.wish.out,
                    on_change=lambda e: self._set(out=e.value),
                ).classes("hm-screen")
                with ui.element("div").classes("hm-row hm-screen"):
                    self.start = ui.button("Start or resume", on_click=self._start)
                    self.stop = ui.button("Stop", on_click=self.campaigns.stop)
                    self.stop.props("color=negative")
                self.bar = ui.linear_progress(0.0, show_value=False)
                self.bar.classes("hm-screen").props(
                    'aria-label="Share of the campaign that is done"'
                )
                self.said = ui.label().classes("hm-verdict").props('role="status"')
                self.links = ui.element("div")
            with card("Built-in plans", printed=False):
                for name in PLANS:
                    ui.button(name, on_click=lambda name=name: self._load(name)).props("flat")
                ui.label("example has every key that a plan may have.").classes("hm-soft")
                self.restore = ui.button("Restore your own plan", on_click=self._restore)
                self.restore.set_visibility(False)
        with ui.element("div").classes("hm-body"), card("Plan"):
            self.text = (
                ui.textarea(
                    "The plan (TOML)",
                    value=self.wish.plan,
                    on_change=lambda e: self._set(plan=e.value),
                )
                .props("autogrow debounce=300 spellcheck=false")
                .classes("hm-screen")
                .style("font-family: ui-monospace, monospace")
            )
            self.paper = ui.label(self.wish.plan).classes("hm-pre hm-on-paper")
            ui.button("Check the plan", on_click=self._check).props("flat")
        self.command = Command()
        self._say_command()
        ui.timer(0.3, self._tick)
        self._tick()

    @property
    def wish(self) -> Campaign:
        """The plan as it is being edited."""
        return self.window.desk.campaign

    def _set(self, **changes: Any) -> None:
        self.window.change(campaign=replace(self.wish, **changes))
        self.paper.set_text(self.wish.plan)
        self._say_command()

    def _say_command(self) -> None:
        self.command.show(f"hmpim campaign plan.toml --out {self.wish.out}")

    def _load(self, name: str) -> None:
        """Show a built-in plan; one that was edited can be had back."""
        if self.wish.plan.strip() and self.wish.plan not in {_shipped(known) for known in PLANS}:
            self.replaced = self.wish.plan
        self.text.set_value(_shipped(name))
        self.restore.set_visibility(bool(self.replaced))

    def _restore(self) -> None:
        self.text.set_value(self.replaced)
        self.restore.set_visibility(False)

    def _check(self) -> None:
        with failures_said():
            plan = checked_plan(self.wish.plan)
            ui.notify(f"{plan.name}. Tests: {len(plan.tests)}; axes: {len(plan.axes)}.")

    def _start(self) -> None:
        with failures_said():
            self.campaigns.start(self.wish.plan, self.wish.out)
        self._tick()

    def _tick(self) -> None:
        campaigns = self.campaigns
        self.start.set_enabled(not campaigns.running)
        self.stop.set_enabled(campaigns.running)
        self.bar.set_value(campaigns.step.share)
        if campaigns.running:
            self.said.set_text(f"{100 * campaigns.step.share:.0f} %: {campaigns.step.what}")
        elif campaigns.end is not None and campaigns.end is not self.shown:
            self.shown = campaigns.end
            self._ended()

    def _ended(self) -> None:
        end, folder = self.campaigns.end, self.campaigns.folder
        self.links.clear()
        if not isinstance(end, Done) or folder is None:
            self.said.set_text(getattr(end, "why", ""))
            return
        self.said.set_text(end.words)
        with self.links:
            for name in ("study.html", "study.json", "study.csv"):
                place = folder / name
                ui.button(
                    name, icon="download", on_click=lambda p=place: ui.download.file(p)
                ).props("flat")


def _shipped(name: str) -> str:
    return shipped_plan(name).read_text(encoding="utf-8")
