"""Make the pictures of docs/workbench.md: every page of a workbench, as a browser draws it.

Run: python benchmarks/workbench_pictures.py [FOLDER]. It needs Chromium and Playwright. With a
folder, every page is drawn there in three sizes, light and dark, to be looked at.
"""

import io
import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page
from served import workbench_in

import hmpim
from hmpim.experiment.readiness import LIGHTS
from hmpim.formats import save
from hmpim.workbench.desks import Analysis, AxisRow, Checked, Desk, Desks, Model, Wish
from hmpim.workbench.work.design import digest

IMAGES = Path(__file__).parents[1] / "docs" / "images"
SIZES = {"phone": (390, 844), "laptop": (1280, 800), "4k": (3840, 2160)}
DESK = "91c7091c7091c709"
COLOURS = 64  # of a picture: plots and text need no more


def record(delay: float, *, rng: int) -> hmpim.Record:
    """A record of the paper's sensor."""
    limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    stimulus = hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    sensor = hmpim.Sensor(
        delay=delay, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    return hmpim.run(sensor, stimulus, rng=rng)


def furnish(runs: Path) -> None:
    """Put three runs into the folder, and a desk on which a whole job stands."""
    for k, delay in enumerate((0.150, 0.149, 0.142), start=1):
        folder = runs / f"sensor_{k}"
        folder.mkdir(parents=True)
        save(record(delay, rng=k), folder / "run.h5")
    wish = Wish(
        rows=(AxisRow(low=0.5, high=20.0),), fs=500.0, model=Model(delay=0.15, damping_ratio=0.4)
    )
    desk = Desk(
        name=DESK,
        wish=wish,
        rig="demo",
        checked=Checked(rig="demo", digest=digest(wish, "demo"), green=LIGHTS),
        analysis=Analysis(
            file="sensor_1/run.h5",
            inputs=("command",),
            outputs=("output",),
            hand={"bandwidth_phase90": 1.6},
        ),
        chosen_runs=tuple(f"sensor_{k}/run.h5" for k in (1, 2, 3)),
    )
    record_1 = hmpim.load(runs / "sensor_1" / "run.h5")
    assert isinstance(record_1, hmpim.Record)
    names = {"inputs": (record_1.inputs[0].name,), "outputs": (record_1.outputs[0].name,)}
    Desks(runs / ".workbench").put(replace(desk, analysis=replace(desk.analysis, **names)))


def drawn(page: Page, count: int = 1) -> None:
    """Wait until so many pictures are drawn."""
    page.wait_for_function(
        "(n) => document.querySelectorAll('.hm-picture[data-drawn]').length >= n", arg=count
    )


def run(page: Page) -> None:
    """Arm the simulated sensor, play the design, and wait for its end."""
    button = page.get_by_role("button", name=re.compile("^(Arm|Disarm)$"))
    if button.inner_text().lower() == "arm":
        button.click()
    page.get_by_role("button", name="Start").click()
    page.get_by_text("The run is over").wait_for()
    drawn(page, 2)


def compare(page: Page) -> None:
    """Compare the three runs, and hold them against a specification."""
    page.get_by_label("Specification").fill("bandwidth_phase90 > 1.55 Hz")
    page.get_by_label("Choose sensor_3/run.h5").wait_for()
    page.get_by_role("button", name="Compare those chosen").click()
    drawn(page, 2)


READY: dict[str, Callable[[Page], object]] = {
    "design": lambda page: drawn(page, 3),
    "check": lambda page: page.get_by_text("All green").wait_for(),
    "run": run,
    "analyse": drawn,
    "runs": compare,
    "campaign": lambda page: page.get_by_role("button", name="Check the plan").wait_for(),
}


def shoot(browser: Browser, url: str, name: str, size: str, *, dark: bool, path: Path) -> None:
    """Draw one page, and keep it with few colours."""
    width, height = SIZES[size]
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark" if dark else "light"
    )
    context.set_default_timeout(240_000)
    page = context.new_page()
    page.goto(f"{url}{name}?desk={DESK}")
    page.wait_for_function("() => window.did_handshake === true")
    READY[name](page)
    page.mouse.move(0, 0)
    page.wait_for_timeout(300)
    shown = Image.open(io.BytesIO(page.screenshot(full_page=path.parent != IMAGES)))
    context.close()
    shown.convert("RGB").quantize(COLOURS).save(path, optimize=True)
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


def main() -> None:
    """Serve a furnished workbench, and draw its pages."""
    given = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    wanted = [(name, "laptop", name in ("run", "runs")) for name in READY]
    wanted += [("analyse", "phone", False)]
    if given is not None:
        given.mkdir(parents=True, exist_ok=True)
        wanted = [(n, size, dark) for n in READY for size in SIZES for dark in (False, True)]
    with tempfile.TemporaryDirectory() as place:
        furnish(Path(place) / "runs")
        with workbench_in(Path(place)) as (url, browser):
            for name, size, dark in wanted:
                kind = f"-{size}" if given is not None or size != "laptop" else ""
                mode = "-dark" if given is not None and dark else ""
                path = (given or IMAGES) / f"workbench-{name}{kind}{mode}.png"
                shoot(browser, url, name, size, dark=dark, path=path)


if __name__ == "__main__":
    main()
