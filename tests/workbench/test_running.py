"""In a browser: design, check, run; stopped by hand and by a lost window; one owner at a time."""

import re
from dataclasses import replace

import pytest

import hmpim
from hmpim.experiment.readiness import LIGHTS
from hmpim.formats.stimulus_files import read_stimulus
from hmpim.workbench.desks import AxisRow, Checked, Desk, Desks, Model, Wish
from hmpim.workbench.work.design import digest
from hmpim.workbench.work.designed import five_axes
from workbench_support import desk_of, go

ROLL = Wish(
    rows=(
        AxisRow(
            name="roll", low=0.5, high=20.0, velocity=800.0, acceleration=30000.0, amplitude=5.0
        ),
    ),
    duration=60.0,
    fs=500.0,
)


def checked(name, wish, rig):
    """A desk at which all lights are green for a design on a rig."""
    done = Checked(rig=rig, digest=digest(wish, rig), green=LIGHTS)
    return Desk(name=name, wish=wish, rig=rig, checked=done)


def kept(served, rig):
    """Records of a rig in the folder of the runs."""
    return sorted(served.runs.glob(f"*_{rig}*/run.h5"))


def wait_until(page, true):
    """Let the browser go on until something is true, for half a minute at most."""
    for _ in range(300):
        if true():
            return
        page.wait_for_timeout(100)
    raise AssertionError("it did not come true")


def start(page, served, desk):
    """Arm and start a desk's rig."""
    Desks(served.runs / ".workbench").put(desk)
    go(page, served, "run", desk.name)
    page.get_by_role("button", name="Arm", exact=True).click()
    page.get_by_role("button", name="Start").click()


def test_a_design_follows_its_sliders_and_stays_inside_its_limits(page, served):
    go(page, served, "design")
    page.get_by_text("inside all limits").wait_for()
    slider = page.get_by_role("slider", name="Amplitude")
    slider.click(position={"x": 1, "y": 10})
    page.get_by_role("cell", name="0.1", exact=True).wait_for()
    slider.locator("[tabindex='0']").press("ArrowRight")
    page.get_by_role("cell", name="0.2", exact=True).wait_for()
    cells = (
        page.get_by_role("row", name=re.compile("velocity")).get_by_role("cell").all_inner_texts()
    )
    assert float(cells[2]) <= float(cells[3])
    page.get_by_label("To (Hz)").fill("900")
    page.get_by_text("reaches the Nyquist frequency").wait_for()
    page.get_by_label("To (Hz)").fill("15")
    page.get_by_text("inside all limits").wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Save and download").click()
    played = read_stimulus(download.value.path().rename(served.runs / "d.csv"))[0]
    assert abs(played.position).max() <= 0.2 * (1 + 1e-9)
    page.reload()
    assert page.get_by_label("To (Hz)").input_value() == "15"


def test_five_axes_run_once_every_light_is_green(page, served):
    rows = tuple(replace(row, low=0.5, amplitude=1.0) for row in five_axes())
    wish = Wish(rows=rows, duration=4.0, fs=500.0, model=Model(noise_std=0.01))
    desk = Desk(name="f1fe0a0e5f1fe0a0", wish=wish, rig="table")
    Desks(served.runs / ".workbench").put(desk)
    go(page, served, "run", desk.name)
    page.get_by_text("make a new check").wait_for()
    assert page.get_by_role("button", name="Start").is_disabled()
    page.get_by_role("link", name="Check").click()
    page.get_by_role("button", name="Check", exact=True).click()
    page.get_by_text("All green").wait_for()
    page.get_by_role("link", name="To the run").click()
    page.get_by_role("button", name="Arm", exact=True).click()
    page.get_by_role("button", name="Start").click()
    page.get_by_text("Played to its end").wait_for()
    assert page.locator(".hm-strip canvas").count() == 5
    (path,) = kept(served, "table")
    record = hmpim.load(path)
    assert [c.name for c in record.inputs] == [f"{r.name}.command" for r in wish.rows]
    page.get_by_role("button", name="Disarm").click()


def test_the_stop_button_ends_a_run_at_once_and_keeps_the_record(page, served):
    start(page, served, checked("570b5070b5070b50", ROLL, "bench"))
    wait_until(page, lambda: kept(served, "bench"))  # the strip may still show an earlier run
    page.wait_for_selector(".hm-strip[data-end]")
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("Ended early: stopped by hand").wait_for()
    record = hmpim.load(kept(served, "bench")[-1])
    assert record.duration < 60.0
    assert any("stopped by hand" in f.message for f in record.findings)
    page.get_by_role("button", name="Disarm").click()


@pytest.mark.study
def test_a_second_window_looks_on_and_cannot_start(page, served, browser):
    start(page, served, checked("a0ea0ea0ea0ea0ea", ROLL, "bench"))
    page.wait_for_selector(".hm-strip canvas")
    other = browser.new_context().new_page()
    Desks(served.runs / ".workbench").put(checked("b0eb0eb0eb0eb0eb", ROLL, "bench"))
    go(other, served, "run", "b0eb0eb0eb0eb0eb")
    other.get_by_text("Running: bench").wait_for()
    assert other.get_by_role("button", name="Arm", exact=True).is_disabled()
    assert other.get_by_role("button", name="Start").is_disabled()
    other.wait_for_selector(".hm-strip canvas")
    before = len(kept(served, "bench"))
    other.keyboard.press("Escape")
    page.get_by_text("Ended early: stopped by hand").wait_for()
    assert len(kept(served, "bench")) == before
    other.get_by_text("Armed by another window").wait_for()
    assert other.get_by_role("button", name="Arm", exact=True).is_disabled()
    other.context.close()
    page.get_by_role("button", name="Disarm").click()


@pytest.mark.study
def test_a_lost_window_ends_its_run_and_the_record_is_kept(page, served, browser):
    context = browser.new_context()
    lost = context.new_page()
    before = len(kept(served, "bench"))
    start(lost, served, checked("10510510510510aa", ROLL, "bench"))
    lost.wait_for_selector(".hm-strip canvas")
    lost.reload()
    lost.wait_for_selector(".hm-strip canvas")
    context.close()
    go(page, served, "run", desk_of(served))
    page.get_by_text("the window that armed the rig is gone").wait_for()
    record = hmpim.load(kept(served, "bench")[before])
    assert record.duration < 60.0
    assert any("is gone" in f.message for f in record.findings)
    log = kept(served, "bench")[before].with_name("run.log").read_text()
    assert "was told to stop" in log
    page.get_by_text("Not armed").wait_for()
