"""In a browser: a foreign file read by eye, runs compared, a campaign stopped and resumed."""

import json
import re

import pytest

import hmpim
from hmpim.formats import save
from hmpim.workbench.desks import Analysis, Campaign, Desk
from tests_support import designed_once
from workbench_support import desk_of, go, wait_until

LIMITS = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
SCRIPT = "<img src=x onerror=window.hacked=1>"


PLAN = """
name = "One sensor"
[rig]
kind = "sensor"
[stimulus]
duration = 3.0
[axes.a]
band = [0.5, 20.0]
limits = { position = 10.0, velocity = 1000.0, acceleration = 40000.0, unit = "deg" }
sensor = { delay = 0.05, noise_std = 0.1 }
[[test]]
name = "levels"
axes = ["a"]
rates = [200.0]
levels = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
"""


def recorded(delay=0.15, rng=1):
    """The paper's sensor under a sweep of 10 s."""
    stimulus = designed_once(band=(0.1, 20), duration=10, fs=200, limits=LIMITS)
    sensor = hmpim.Sensor(
        delay=delay, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    return hmpim.run(sensor, stimulus, rng=rng)


@pytest.mark.study
def test_a_foreign_file_is_dropped_identified_read_by_eye_and_reported(page, served, tmp_path):
    record = recorded()
    u, y = record.inputs[0].values, record.outputs[0].values
    rows = "\n".join(f"{k / 200};{a};{b}" for k, (a, b) in enumerate(zip(u, y, strict=True)))
    file = tmp_path / "bench log.txt"
    file.write_text(f"# rig 7\ntime [s];kommando [deg];{SCRIPT}\n{rows}\n")
    go(page, served, "analyse")
    page.set_input_files("input[type=file]", file)
    for role, channel in (("Inputs", "kommando"), ("Outputs", "<img")):
        page.get_by_role("combobox", name=role).click()
        page.get_by_role("option", name=re.compile(channel)).click()
        page.keyboard.press("Escape")
    page.get_by_role("button", name="Identify").click()
    line = page.get_by_role("row", name=re.compile("^Bandwidth, −90° [0-9]"))
    line.wait_for()
    automatic = float(line.get_by_role("cell").nth(1).inner_text().split()[0])
    assert automatic == pytest.approx(1.534, abs=0.01)
    page.wait_for_selector(
        "[aria-label^='Magnitude and phase'][data-drawn], .hm-picture[data-drawn]"
    )
    assert page.evaluate("window.hacked") is None
    assert page.locator("main img").count() == 0
    assert page.get_by_text(SCRIPT).first.is_visible()

    # The line at −90° is dragged to twice the frequency: a third of a decade on a logarithmic axis.
    drag = """(factor) => {
        const plot = document.querySelector(".hm-picture"), layout = plot._fullLayout;
        const k = layout.shapes.findIndex((s) => s.name === "bandwidth_phase90");
        const x = layout.xaxis2, y = layout.yaxis2, box = plot.getBoundingClientRect();
        const at = layout.shapes[k].x0;
        const where = (f) => box.left + x._offset + x.d2p(f);
        return [where(at), where(factor * at), box.top + y._offset + 0.3 * y._length];
    }"""
    page.locator(".hm-picture").first.scroll_into_view_if_needed()
    x0, x1, height = page.evaluate(drag, 2.0)
    page.mouse.move(x0, height)
    page.mouse.down()
    page.mouse.move((x0 + x1) / 2, height, steps=4)
    page.mouse.move(x1, height, steps=4)
    page.mouse.up()
    by_hand = line.get_by_text("by hand")
    by_hand.wait_for()
    value = float(re.search(r"[\d.]+", by_hand.inner_text()).group())
    assert value == pytest.approx(2.0 * automatic, rel=0.05)
    assert float(line.get_by_role("cell").nth(1).inner_text().split()[0]) == automatic
    page.get_by_text("nothing was measured").or_(page.get_by_text("measured")).first.wait_for()

    page.get_by_label("Delay by hand (s)").fill("0.15")
    page.get_by_text("0.15, by hand").wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Report").click()
    text = download.value.path().read_text(encoding="utf-8")
    assert "by hand: −90° bandwidth" in text
    assert SCRIPT not in text
    page.reload()
    page.get_by_text("0.15, by hand").wait_for()


def test_a_file_too_large_is_refused_and_a_hostile_name_stays_inside(page, served):
    go(page, served, "analyse")
    before = {p for p in served.runs.parent.rglob("*") if p.is_file()}
    page.set_input_files(
        "input[type=file]", {"name": "big.csv", "mimeType": "text/csv", "buffer": b"0" * 1_200_000}
    )
    page.get_by_text("more than 1 MB").wait_for()
    hostile = "../../../<script>alert(1)</script>.csv"
    upload = """async ([url, name]) => {
        const form = new FormData();
        form.append("file", new Blob(["t,u,y\\n0,1,2\\n"]), name);
        return (await fetch(url, {method: "POST", body: form})).status;
    }"""
    url = page.evaluate(
        "() => Object.values(window.mounted_app?.elements ?? {}).find(e => e.props?.url)?.props.url"
    )
    if url is not None:
        assert page.evaluate(upload, [f"/{served.token}{url}", hostile]) == 200
        wait_until(lambda: list((served.runs / "uploads").glob("*script*")))
    new = {p for p in served.runs.parent.rglob("*") if p.is_file()} - before
    assert all(served.runs in p.parents for p in new)
    assert not any("<" in p.name or p.name == "big.csv" for p in new)


def test_two_runs_are_compared_and_held_against_a_specification(page, served):
    for k, delay in enumerate((0.15, 0.12), start=1):
        (served.runs / f"unit{k}").mkdir()
        save(recorded(delay, rng=k), served.runs / f"unit{k}" / "run.h5")
    go(page, served, "runs")
    for k in (1, 2):
        box = page.get_by_label(f"Choose unit{k}/run.h5")
        for _ in range(10):  # a click before the page is connected is lost
            box.click()
            page.wait_for_timeout(1000)
            if box.get_attribute("aria-checked") == "true":
                break
    page.get_by_role("button", name="Compare those chosen").click()
    page.get_by_text("Bode plots over each other").wait_for()
    cells = page.get_by_role("row", name=re.compile("^Delay, pure")).get_by_role("cell")
    values = [float(t.split()[0]) for t in cells.all_inner_texts()[1:]]
    assert values == pytest.approx([0.15, 0.12], abs=1e-3)
    page.get_by_label("Specification").fill("delay < 0.13")
    page.get_by_role("button", name="Look again").click()
    page.get_by_role("row", name=re.compile("unit1.*fail")).wait_for()
    assert page.get_by_role("row", name=re.compile("unit2.* ok ok ")).count() == 1


@pytest.mark.study
def test_a_campaign_is_stopped_and_resumed_and_its_study_downloaded(page, served):
    desk = Desk(name="ca3ba19ca3ba19ca", campaign=Campaign(plan=PLAN, out="../study one"))
    go(page, served, "campaign", desk_of(served, desk))
    page.get_by_role("button", name="Start or resume").click()
    cases = served.runs / "study one" / "cases"
    wait_until(lambda: len(list(cases.glob("*.json"))) >= 1, seconds=120)
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("start it again to go on").wait_for()
    first = {p.name: p.stat().st_mtime_ns for p in cases.glob("*.json")}
    page.reload()
    page.get_by_role("button", name="Start or resume").click()
    with page.expect_download(timeout=120_000) as download:
        page.get_by_role("button", name="study.json").click(timeout=120_000)
    study = json.loads(download.value.path().read_text(encoding="utf-8"))
    assert len(study["rows"]) >= len(first)
    assert all((cases / name).stat().st_mtime_ns == t for name, t in first.items())


@pytest.mark.study
def test_a_plan_may_not_name_code(page, served):
    code = PLAN.replace('kind = "sensor"', 'kind = "python"\nentry = "os:system"')
    assert code != PLAN
    desk = Desk(name="0bad0bad0bad0bad", campaign=Campaign(plan=code))
    go(page, served, "campaign", desk_of(served, desk))
    page.get_by_role("button", name="Start or resume").click()
    page.get_by_role("alert").first.wait_for()
    assert not (served.runs / "campaign").exists()


@pytest.mark.study
def test_nothing_is_lost_by_a_reload_and_a_second_window_gets_a_desk_of_its_own(
    page, served, browser
):
    save(recorded(), served.runs / "kept.csv")
    desk = Desk(name="5ec05ec05ec05ec0", analysis=Analysis(file="kept.csv", alpha=2.0))
    go(page, served, "analyse", desk_of(served, desk))
    page.get_by_label("To (s)").fill("8")
    page.get_by_label("To (s)").press("Tab")
    other = browser.new_context().new_page()
    go(other, served, "analyse", desk.name)
    other.wait_for_url(lambda url: desk.name not in url)
    other.get_by_label("To (s)").fill("5")
    other.get_by_label("To (s)").press("Tab")
    other.context.close()
    page.reload()
    page.wait_for_function("() => document.querySelector('[aria-label=\"To (s)\"]')?.value === '8'")
    assert desk.name in page.url
