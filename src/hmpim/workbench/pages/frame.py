"""The frame of every page: address, desk, navigation, light and dark, what went wrong."""

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any

from fastapi import Request
from fastapi.responses import RedirectResponse
from nicegui import Client, ui

from hmpim.errors import HmpimError
from hmpim.workbench.bench import Window, Workbench

__all__ = [
    "PAGES",
    "Build",
    "Command",
    "Later",
    "add_front",
    "add_page",
    "card",
    "failures_said",
    "heading",
]

PAGES = {
    "design": "Design",
    "check": "Check",
    "run": "Run",
    "analyse": "Analyse",
    "runs": "Runs",
    "campaign": "Campaign",
}

Later = Callable[[], Awaitable[None]]
Build = Callable[[Window], Later | None]
"""Makes a page at once; what it returns is done when the browser shows it, and may take long."""


def add_page(workbench: Workbench, name: str, build: Build) -> None:
    """Add a page.

    Parameters
    ----------
    workbench : Workbench
        Shared by all.
    name : str
        Last part of its address, one of `PAGES`.
    build : callable
        Makes what stands on it, at once; returns what is to be done when it is shown, or None.
    """

    @ui.page(f"/{name}", title=f"{PAGES[name]} · hmpim")
    async def page(request: Request, client: Client, desk: str = "") -> Any:
        found = workbench.desks.get(desk)
        if found is None:
            chosen = workbench.desks.latest(without=workbench.open_desks)
            return RedirectResponse(f"{_root(request)}/{name}?desk={chosen.name}", 303)
        window = Window(workbench, found.name)
        _frame(window, name)
        with ui.element("div").classes("hm-main").props('id="main"'):
            ui.label(PAGES[name]).props('role="heading" aria-level="1"').classes("hm-title")
            later = build(window)
        _watch(window, client, name)
        if later is not None:
            await client.connected(timeout=60.0)
            with failures_said():
                await later()
        return None


def add_front(workbench: Workbench) -> None:
    """Add the address without a page: it leads to the analysis, where most begin."""

    @ui.page("/")
    async def front(request: Request) -> Any:
        return RedirectResponse(f"{_root(request)}/analyse", 303)


def _root(request: Request) -> str:
    return str(request.scope.get("root_path", "")).rstrip("/")


def _watch(window: Window, client: Client, name: str) -> None:
    """Give a second window on the same desk a desk of its own."""
    workbench = window.workbench
    open_tabs: list[str] = []  # a client that has gone no longer says which tab it was

    async def came() -> None:
        tab = client.tab_id or client.id
        if workbench.opened(window.name, tab):
            workbench.closed(window.name, tab)
            copy = workbench.desks.copy(window.desk)
            client.open(f"/{name}?desk={copy.name}")
        else:
            open_tabs.append(tab)

    def went() -> None:
        if open_tabs:
            workbench.closed(window.name, open_tabs.pop())

    client.on_connect(came)
    client.on_disconnect(went)


def _frame(window: Window, name: str) -> None:
    ui.html('<a class="hm-skip" href="#main">Skip to the page</a>', sanitize=False)
    ui.colors(primary="#0b5cad", positive="#1a7f4b", negative="#b3261e")
    dark = ui.dark_mode(window.desk.dark)
    with ui.element("header").classes("hm-header"):
        ui.label("hmpim").classes("hm-brand")
        with ui.element("nav").props('aria-label="Pages"').classes("hm-nav"):
            for target, words in PAGES.items():
                link = ui.link(words, f"/{target}?desk={window.name}").classes("hm-link")
                if target == name:
                    link.props('aria-current="page"')

        def turn() -> None:
            dark.value = {None: True, True: False, False: None}[dark.value]
            window.change(dark=dark.value)

        ui.button(icon="contrast", on_click=turn).props(
            'flat round dense aria-label="Light, dark or as the system"'
        )


@contextmanager
def failures_said() -> Iterator[None]:
    """Say on the page what is wrong with what was given, in one line."""
    try:
        yield
    except (HmpimError, OSError) as error:
        said = " ".join(str(error).split())
        ui.notify(said, type="negative", multi_line=True, timeout=12000, close_button="Close")


@contextmanager
def card(title: str, *, wide: bool = False, printed: bool = True) -> Iterator[ui.element]:
    """A part of a page with its own heading.

    Parameters
    ----------
    title : str
        In a few words.
    wide : bool
        Whether it takes the whole width.
    printed : bool
        Whether it is of any use on paper.
    """
    classes = "hm-card" + " hm-wide" * wide + " hm-screen" * (not printed)
    with ui.element("section").classes(classes).props(f'aria-label="{title}"') as section:
        heading(title)
        yield section


def heading(words: str) -> None:
    """A heading of second rank."""
    ui.label(words).props('role="heading" aria-level="2"').classes("hm-heading")


class Command:
    """The command that does the same, to be copied; `show` replaces it."""

    def __init__(self, words: str = "") -> None:
        with ui.element("details").classes("hm-command hm-wide"):
            with ui.element("summary"):
                ui.label("The same from Python or the command line")
            self._text = ui.label(words).classes("hm-pre")
            self._text.props('tabindex=0 role="region" aria-label="The command"')

    def show(self, words: str) -> None:
        """Show this."""
        self._text.set_text(words)
