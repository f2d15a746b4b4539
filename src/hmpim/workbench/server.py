"""The server: one application behind its lock, on loopback."""

import asyncio
import contextlib
import socket
import webbrowser
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hmpim.errors import ArgumentError, MissingExtraError
from hmpim.workbench.lock import Lock, fresh_token
from hmpim.workbench.settings import Settings

__all__ = ["Address", "serve"]

_HOST = "127.0.0.1"
_PING = 3.0  # s between two signs of life that a page is asked for
_SILENCE = 12.0  # s without one after which a page counts as gone: a busy browser is not
_REMEMBERED = 30.0  # s for which a page that is gone may come back to what it showed


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where the workbench is served."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """Address to open; whoever has it may use the workbench."""
        return f"http://{_HOST}:{self.port}/{self.token}/"


def serve(
    settings: Settings,
    *,
    ready: Callable[[Address], object],
    browser: bool = True,
) -> None:
    """Serve the workbench until Ctrl-C.

    Parameters
    ----------
    settings : Settings
        What the command line said.
    ready : callable
        Called with the address once it is served.
    browser : bool
        Whether to open it in the browser.

    Raises
    ------
    MissingExtraError
        If NiceGUI is not installed.
    ArgumentError
        If the port is taken, or the folder of the runs cannot be made.
    """
    try:
        import uvicorn
    except ImportError as error:
        raise MissingExtraError(
            "the workbench needs NiceGUI; install it with pip install 'hmpim[workbench]'"
        ) from error
    try:
        settings.runs.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"folder {settings.runs} cannot be made: {error.strerror}") from error
    listening = _listening(settings.port)
    address = Address(port=listening.getsockname()[1], token=fresh_token())

    def begun() -> None:
        ready(address)
        if browser:
            webbrowser.open(address.url)

    app = Lock(
        application(settings, begun=begun),
        token=address.token,
        port=address.port,
        largest=settings.largest,
    )
    config = uvicorn.Config(
        app,
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=2,
        ws_max_size=16_000_000,
    )
    with contextlib.suppress(KeyboardInterrupt):
        uvicorn.Server(config).run(sockets=[listening])


def application(settings: Settings, *, begun: Callable[[], object]) -> Any:
    """Return the application without its lock.

    Parameters
    ----------
    settings : Settings
        What the command line said.
    begun : callable
        Called once requests are answered.
    """
    try:
        from fastapi import FastAPI
        from nicegui import app as pages
        from nicegui import core, ui
    except ImportError as error:
        raise MissingExtraError(
            "the workbench needs NiceGUI; install it with pip install 'hmpim[workbench]'"
        ) from error

    from hmpim.workbench.bench import Workbench
    from hmpim.workbench.pages import add_pages

    workbench = Workbench(settings)
    whole = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    add_pages(workbench, whole)

    async def start() -> None:
        core.sio.eio.ping_interval = _PING
        core.sio.eio.ping_timeout = _SILENCE
        workbench.start()
        asyncio.get_running_loop().call_soon(begun)

    pages.on_startup(start)
    pages.on_shutdown(workbench.stop)
    ui.run_with(
        whole,
        title="hmpim workbench",
        dark=None,
        language="en-US",
        tailwind=False,
        reconnect_timeout=_REMEMBERED,
        show_welcome_message=False,
    )
    return whole


def _listening(port: int) -> socket.socket:
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((_HOST, port))
    except (OSError, OverflowError) as error:
        listening.close()
        raise ArgumentError(f"port {port} cannot be served: {error}; try --port 0") from error
    return listening
