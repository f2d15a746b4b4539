"""One workbench, served in a process of its own, and one browser that looks at it.

All tests that need them stand in one file: a file's tests share a process, and so both are started
once.
"""

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


@pytest.fixture(scope="session")
def served(tmp_path_factory):
    """A workbench with a motion table that moves in real time, and uploads of at most 1 MB."""
    folder = tmp_path_factory.mktemp("workbench")
    (folder / "hmpim.toml").write_text(RIGS)
    bench = serve(folder, "--max-upload", "1", "--grace", "10")
    yield bench
    ended(bench)
    errors = (folder / "errors.txt").read_text()
    assert "Traceback" not in errors, errors
    assert "been deleted" not in errors, errors


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
def window(browser, served):
    """Makes pages in windows of their own; an error in a page's scripts fails the test."""
    contexts, faults = [], []

    def opened():
        context = browser.new_context(viewport={"width": 1280, "height": 800})
        context.set_default_timeout(90_000)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", lambda r: r.url.startswith(("http://127.0.0.1", "data:", "blob:"))
                or faults.append(f"asked {r.url}"))  # fmt: skip
        return page

    yield opened
    for context in contexts:
        context.close()
    assert not faults


@pytest.fixture
def page(window):
    """A page in a window of its own."""
    return window()
