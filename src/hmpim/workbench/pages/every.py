"""All pages of the workbench, and the files that it hands out."""

from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import FileResponse, PlainTextResponse, Response
from fastapi.staticfiles import StaticFiles
from nicegui import ui

from hmpim.workbench.bench import Workbench
from hmpim.workbench.pages.analyse import analyse
from hmpim.workbench.pages.campaign import campaign
from hmpim.workbench.pages.check import check
from hmpim.workbench.pages.design import design
from hmpim.workbench.pages.frame import Build, add_front, add_page
from hmpim.workbench.pages.run import run
from hmpim.workbench.pages.runs import runs

__all__ = ["add_pages"]

_PAGES: dict[str, Build] = {
    "design": design,
    "check": check,
    "run": run,
    "analyse": analyse,
    "runs": runs,
    "campaign": campaign,
}
_STATIC = Path(__file__).parents[1] / "static"
_SANDBOX = {"content-security-policy": "sandbox allow-scripts; default-src 'none'; "
            "img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"}  # fmt: skip


def add_pages(workbench: Workbench, app: FastAPI) -> None:
    """Add every page and the hand-out of files.

    Parameters
    ----------
    workbench : Workbench
        Shared by all.
    app : FastAPI
        Into which NiceGUI is mounted; what is added here is asked first.
    """
    ui.add_css((_STATIC / "workbench.css").read_text(encoding="utf-8"), shared=True)
    for script in ("early.js", "named.js"):
        text = (_STATIC / script).read_text(encoding="utf-8")
        ui.add_head_html(f"<script>{text}</script>", shared=True)
    add_front(workbench)
    for name, build in _PAGES.items():
        add_page(workbench, name, build)
    app.mount("/static", StaticFiles(directory=_STATIC))

    @app.get("/files/{path:path}")
    def hand_out(path: str) -> Response:
        """Hand out a file of the runs' folder; a page of ours runs in a sandbox."""
        root = workbench.settings.runs.resolve()
        file = (root / path).resolve()
        if not file.is_relative_to(root) or not file.is_file():
            return PlainTextResponse("there is no such file", 404)
        return FileResponse(
            file,
            filename=file.name,
            headers=dict(_SANDBOX),
            content_disposition_type="inline" if file.suffix == ".html" else "attachment",
        )
