"""A workbench served from a folder, and a browser to look at it with."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright


@contextmanager
def workbench_in(folder: Path) -> Iterator[tuple[str, Browser]]:
    """Serve a folder's workbench with its runs in `runs`; its address, and Chromium."""
    with sync_playwright() as playwright:
        served = subprocess.Popen(
            [sys.executable, "-m", "hmpim.cli.main", "workbench", "--no-browser", "--runs", "runs"],
            cwd=folder, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        try:
            assert served.stdout is not None
            found = re.search(r"http://\S+", served.stdout.readline())
            assert found is not None
            browser = playwright.chromium.launch(
                executable_path="/usr/bin/chromium", args=["--no-sandbox"]
            )
            try:
                yield found.group(), browser
            finally:
                browser.close()
        finally:
            served.terminate()
            served.wait()
