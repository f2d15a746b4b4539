"""A workbench that is served in a process of its own, and a browser that looks at it."""

import os
import shutil

import pytest

from tests_support import missing
from workbench_support import ended, serve

RIGS = """
[rigs.bench]
rig = "table"
[rigs.bench.options]
realtime = true
"""


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A workbench with a motion table that moves in real time, and uploads of at most 1 MB."""
    folder = tmp_path_factory.mktemp("workbench")
    (folder / "hmpim.toml").write_text(RIGS)
    bench = serve(folder, "--max-upload", "1", "--grace", "1", "--rig", "table")
    yield bench
    ended(bench)
    errors = (folder / "errors.txt").read_text()
    assert "Traceback" not in errors, errors


@pytest.fixture(scope="session")
def browser():
    """Chromium, driven by Playwright."""
    path = shutil.which("chromium") or missing("chromium", "the browser Chromium")
    api = pytest.importorskip("playwright.sync_api") if not _must() else __import__(
        "playwright.sync_api", fromlist=["sync_playwright"]
    )  # fmt: skip
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(
            executable_path=path, args=["--no-sandbox", "--disable-gpu"]
        )
        yield found
        found.close()


def _must() -> bool:
    return "chromium" in os.environ.get("HMPIM_TESTS_MUST_RUN", "").split(",")


@pytest.fixture
def page(browser, served):
    """A page in a window of its own; an error in its scripts fails the test."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(60_000)
    shown = context.new_page()
    faults = []
    shown.on("pageerror", lambda error: faults.append(str(error)))
    shown.on("request", lambda r: r.url.startswith(("http://127.0.0.1", "data:", "blob:"))
             or faults.append(f"asked {r.url}"))  # fmt: skip
    yield shown
    context.close()
    assert not faults
