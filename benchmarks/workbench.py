"""How quickly the workbench answers: slider, live strip, a million samples.

Run on an idle machine: python benchmarks/workbench.py. It needs Chromium and Playwright.
"""

import statistics
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
from playwright.sync_api import Page
from served import workbench_in

import hmpim
from hmpim.experiment.readiness import LIGHTS
from hmpim.formats import save
from hmpim.workbench.desks import Analysis, AxisRow, Checked, Desk, Desks, Wish
from hmpim.workbench.work.design import digest

SLIDES = 30
MINUTE = 60.0  # s of the live strip
MILLION = 1_000_000
RIGS = '[rigs.bench]\nrig = "table"\n[rigs.bench.options]\nrealtime = true\n'

DRAWN = "(n) => document.querySelectorAll('.hm-picture[data-drawn]').length >= n"
CLOCKED = """([label, shows, up]) => {
    const plots = [...document.querySelectorAll(".hm-picture[data-drawn]")];
    const plot = plots.find((one) => one.getAttribute("aria-label").startsWith(shows));
    const slider = document.querySelector(`input[type=range][aria-label="${label}"]`);
    return new Promise((done) => {
        const begun = performance.now();
        new MutationObserver((_, observer) => {
            observer.disconnect();
            done(performance.now() - begun);
        }).observe(plot, { attributes: true, attributeFilter: ["data-drawn"] });
        if (up) slider.stepUp();
        else slider.stepDown();
        slider.dispatchEvent(new Event("input"));
    });
}"""


LONGEST = """
window.longest = 0;
new PerformanceObserver((list) => {
    for (const task of list.getEntries()) window.longest = Math.max(window.longest, task.duration);
}).observe({ type: "longtask", buffered: true });
"""
ZOOMED = """async ([low, high]) => {
    const { Plotly } = await import("nicegui-plotly");
    const plot = document.querySelector("section[aria-label^=Stimulus] .hm-picture");
    const begun = performance.now(), before = plot.dataset.refilled;
    await Plotly.relayout(plot, { "xaxis.range[0]": low, "xaxis.range[1]": high });
    const moved = performance.now() - begun;
    while (plot.dataset.refilled === before) await new Promise((done) => setTimeout(done, 1));
    return [moved, performance.now() - begun, plot.data[0].x.length];
}"""


def slider(page: Page, url: str, desks: Desks) -> None:
    """Time from a slider's step to the redrawn plot that shows it, 10 s at 1 kHz."""
    for label, shows in (
        ("Window α", "Spectra"),
        ("Extinction n (0: solved)", "Position"),
        ("Amplitude, share of the limit", "Position"),
    ):
        desk = desks.put(Desk(name="5110e25110e25110", wish=Wish(extinction=0.5)))
        page.goto(f"{url}design?desk={desk.name}")
        page.wait_for_function(DRAWN, arg=3)
        times = []
        for k in range(SLIDES):
            times.append(page.evaluate(CLOCKED, [label, shows, k % 2 == 1]))
            time.sleep(0.2)
        middle, worst = statistics.median(times), max(times)
        print(f"slider, {label.split(',')[0]}: median {middle:.0f} ms, worst {worst:.0f} ms")


def strip(page: Page, url: str, desks: Desks) -> None:
    """How far a strip of five axes at 1 kHz is behind the run, for a minute."""
    from hmpim.workbench.work.designed import five_axes

    rows = tuple(AxisRow(**{**_fields(row), "low": 0.1, "amplitude": 2.0}) for row in five_axes())
    wish = Wish(rows=rows, duration=MINUTE, fs=1000.0)
    checked = Checked(rig="bench", digest=digest(wish, "bench"), green=LIGHTS)
    desk = desks.put(Desk(name="571b571b571b571b", wish=wish, rig="bench", checked=checked))
    page.goto(f"{url}run?desk={desk.name}")
    page.get_by_role("button", name="Arm", exact=True).click()
    page.get_by_role("button", name="Start").click(timeout=120_000)
    page.wait_for_selector(".hm-strip canvas", timeout=120_000)
    behind = []
    begun, first = time.perf_counter(), _end(page)
    while (end := _end(page)) < MINUTE - 2.0:
        behind.append((time.perf_counter() - begun) - (end - first))
        time.sleep(0.25)
    middle, worst = statistics.median(behind), max(behind)
    print(f"strip, five axes at 1 kHz, {MINUTE:g} s: {middle:.2f} s behind, {worst:.2f} s at most")


def _fields(row: AxisRow) -> dict[str, object]:
    return {name: getattr(row, name) for name in AxisRow.__dataclass_fields__}


def _end(page: Page) -> float:
    return float(page.evaluate("() => document.querySelector('.hm-strip')?.dataset.end ?? 0"))


def million(page: Page, url: str, desks: Desks, runs: Path) -> None:
    """A record of a million samples: opened, identified, zoomed, and what page and server do."""
    rng = np.random.default_rng(1)
    t = np.arange(MILLION) / 1000.0
    u = np.sin(2 * np.pi * (0.1 * t + 0.5 * 20.0 / t[-1] * t**2))
    y = np.interp(t - 0.05, t, u, left=0.0) + 0.01 * rng.standard_normal(MILLION)
    save(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=1000.0), runs / "million.h5")
    analysis = Analysis(file="million.h5", inputs=("u",), outputs=("y",))
    desk = desks.put(Desk(name="a1110a1110a1110a", analysis=analysis))
    page.add_init_script(LONGEST)
    begun = time.perf_counter()
    page.goto(f"{url}analyse?desk={desk.name}")
    slowest, done = 0.0, page.get_by_text("Delay, pure")
    while done.count() == 0:
        asked = time.perf_counter()
        with urllib.request.urlopen(f"{url}static/workbench.css") as answer:
            answer.read()
        slowest = max(slowest, time.perf_counter() - asked)
        time.sleep(0.05)
    page.wait_for_function(DRAWN, arg=8, timeout=120_000)
    seconds = time.perf_counter() - begun
    held = page.evaluate("() => window.longest")
    print(f"{MILLION} samples: opened, identified and drawn in {seconds:.1f} s;")
    print(f"  the server answered within {1e3 * slowest:.0f} ms meanwhile, the page {held:.0f} ms")
    moved, filled, samples = page.evaluate(ZOOMED, [MILLION / 3000 - 0.3, MILLION / 3000 + 0.3])
    print(f"  zoomed to 0.6 s: {moved:.0f} ms, all {samples} samples there after {filled:.0f} ms")


def main() -> None:
    """Serve a workbench, and measure it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "hmpim.toml").write_text(RIGS, encoding="utf-8")
        with workbench_in(folder) as (url, browser):
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.set_default_timeout(300_000)
            desks = Desks(folder / "runs" / ".workbench")
            slider(page, url, desks)
            million(page, url, desks, folder / "runs")
            strip(page, url, desks)


if __name__ == "__main__":
    main()
