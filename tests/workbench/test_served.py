"""A served workbench: its lock seen from outside, and each of its jobs done in a browser."""

import contextlib
import http.client
import json
import re
import secrets
from dataclasses import replace

import pytest

import hmpim
from hmpim.formats import save
from hmpim.formats.stimulus_files import read_stimulus
from hmpim.report.numbers import typeset
from hmpim.workbench.desks import Analysis, Campaign, Desk, Desks, Model, Wish
from hmpim.workbench.work.designed import five_axes
from workbench_support import ROLL, checked, desk_of, go, kept, recorded, wait_until

KEY = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
       "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}  # fmt: skip
SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
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
levels = [0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65]
"""


# The lock, from outside.


def asked(served, path, headers=None, *, host=None, method="GET", body=None):
    """Status and body of what the server answers."""
    line = http.client.HTTPConnection("127.0.0.1", served.port, timeout=60)
    try:
        line.putrequest(method, path, skip_host=True)
        line.putheader("Host", host or f"127.0.0.1:{served.port}")
        for name, value in (headers or {}).items():
            line.putheader(name, value)
        if body is not None:
            line.putheader("Content-Length", str(len(body)))
        line.endheaders()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            line.send(body or b"")  # it may be refused before it is all sent
        answer = line.getresponse()
        return answer.status, b"" if answer.status == 101 else answer.read()
    finally:
        line.close()


def test_the_command_of_its_page_serves_pages_on_loopback_alone(served):
    assert served.url.startswith("http://127.0.0.1:")
    status, page = asked(served, f"/{served.token}/design?desk={desk_of(served)}")
    assert status == 200
    assert b"Design" in page
    assert b"hmpim" in page


@pytest.mark.parametrize("path", ["/", "/analyse", "/run", "/static/workbench.css", SOCKET,
                                  "/files/plan.toml", "/wrong/analyse"])  # fmt: skip
def test_nothing_is_answered_without_the_token(served, path):
    assert asked(served, path)[0] == 403


def test_a_foreign_origin_and_a_rebound_host_are_refused_on_pages_and_sockets(served):
    root, own = f"/{served.token}", f"http://127.0.0.1:{served.port}"
    assert asked(served, f"{root}/analyse", {"Origin": own})[0] in (200, 303)
    assert asked(served, f"{root}{SOCKET}", {**KEY, "Origin": own})[0] == 101
    for origin in ("http://evil.test", "null", f"http://127.0.0.1:{served.port + 1}"):
        assert asked(served, f"{root}/analyse", {"Origin": origin})[0] == 403
        assert asked(served, f"{root}{SOCKET}", {**KEY, "Origin": origin})[0] == 403
    assert asked(served, f"{root}{SOCKET}", KEY)[0] == 403
    for host in ("evil.test", f"evil.test:{served.port}", "127.0.0.1"):
        assert asked(served, f"{root}/analyse", host=host)[0] == 403
        assert asked(served, f"{root}{SOCKET}", {**KEY, "Origin": own}, host=host)[0] == 403


def test_a_body_beyond_the_size_is_refused(served):
    status, said = asked(served, f"/{served.token}/analyse", method="POST", body=b"0" * 1_100_000)
    assert (status, b"more than 1 MB" in said) == (413, True)


def test_files_are_handed_out_from_the_folder_of_the_runs_alone(served):
    (served.runs / "a.json").write_text(json.dumps({"a": 1}))
    root = f"/{served.token}/files"
    assert asked(served, f"{root}/a.json") == (200, b'{"a": 1}')
    (served.runs.parent / "secret.txt").write_text("secret")
    for path in ("../secret.txt", "%2e%2e/secret.txt", "..%2fsecret.txt", "/etc/passwd"):
        assert asked(served, f"{root}/{path}")[0] == 404


# Design, check, run.


def start(page, served, desk):
    """Arm and start a desk's rig; return the folder of its run."""
    before = kept(served, desk.rig)
    go(page, served, "run", desk_of(served, desk))
    page.get_by_role("button", name="Arm", exact=True).click()
    page.get_by_role("button", name="Start").click()
    wait_until(lambda: len(kept(served, desk.rig)) > len(before), page=page)
    page.wait_for_selector(".hm-strip[data-end]")
    return kept(served, desk.rig)[-1].parent


HIGHEST = """([low, high]) => {
    const motion = document.querySelector(".hm-picture[data-drawn]");
    const most = Math.max(...motion.data[0].y.map(Math.abs));
    return Number(motion.dataset.drawn) > 1 && most >= low && most <= high * (1 + 1e-9);
}"""


@pytest.mark.browser
def test_a_design_follows_its_sliders_and_stays_inside_its_limits(page, served):
    go(page, served, "design")
    page.get_by_text("inside all limits").wait_for()
    slider = page.get_by_role("slider", name="Amplitude")
    slider.click(position={"x": 1, "y": 10})
    page.get_by_role("cell", name="0.1", exact=True).wait_for()
    slider.press("ArrowRight")
    page.get_by_role("cell", name="0.2", exact=True).wait_for()
    # the curve was moved, not the picture drawn anew: it is the one that the table speaks of
    page.wait_for_function(HIGHEST, arg=[0.199, 0.2])
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


@pytest.mark.browser
def test_five_axes_run_once_every_light_is_green(page, served):
    rows = tuple(replace(row, low=0.5, amplitude=1.0) for row in five_axes())
    wish = Wish(rows=rows, duration=4.0, fs=500.0, model=Model(noise_std=0.01))
    desk = Desk(name=secrets.token_hex(8), wish=wish, rig="table")
    go(page, served, "run", desk_of(served, desk))
    page.get_by_text("make a new check").wait_for()
    assert page.get_by_role("button", name="Start").is_disabled()
    page.get_by_role("link", name="Check").click()
    page.get_by_role("button", name="Check", exact=True).click()
    page.get_by_text("All green").wait_for()
    page.get_by_role("link", name="To the run").click()
    page.get_by_role("button", name="Arm", exact=True).click()
    page.get_by_role("button", name="Start").click()
    page.get_by_text("Played to the end").wait_for()
    assert page.locator(".hm-strip canvas").count() == 5
    (path,) = kept(served, "table")
    record = hmpim.load(path)
    assert [c.name for c in record.inputs] == [f"{r.name}.command" for r in wish.rows]
    page.get_by_role("button", name="Disarm").click()


@pytest.mark.browser
def test_a_second_window_looks_on_cannot_start_and_may_stop(page, served, window):
    folder = start(page, served, checked(ROLL, "bench"))
    other = window()
    go(other, served, "run", desk_of(served, checked(ROLL, "bench")))
    other.get_by_text("Running: bench").wait_for()
    assert other.get_by_role("button", name="Arm", exact=True).is_disabled()
    assert other.get_by_role("button", name="Start").is_disabled()
    other.wait_for_selector(".hm-strip[data-end]")
    other.keyboard.press("Escape")
    page.get_by_text("Ended early: stopped by hand").wait_for()
    assert kept(served, "bench")[-1].parent == folder
    other.get_by_text("Armed by another window").wait_for()
    assert other.get_by_role("button", name="Arm", exact=True).is_disabled()
    page.get_by_role("button", name="Disarm").click()
    other.get_by_text("Not armed").wait_for()


def test_the_stop_button_ends_a_run_at_once_and_keeps_the_record(page, served):
    folder = start(page, served, checked(ROLL, "bench"))
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("Ended early: stopped by hand").wait_for()
    record = hmpim.load(folder / "run.h5")
    assert record.duration < 300.0
    assert any("stopped by hand" in f.message for f in record.findings)
    page.get_by_role("button", name="Disarm").click()


@pytest.mark.browser
def test_a_lost_window_ends_its_run_and_the_record_is_kept(page, served, window):
    lost = window()
    folder = start(lost, served, checked(ROLL, "bench"))
    lost.reload()
    lost.wait_for_selector(".hm-strip[data-end]")
    lost.context.close()
    go(page, served, "run")
    page.get_by_text("Ended early: the window that armed the rig is gone").wait_for()
    record = hmpim.load(folder / "run.h5")
    assert record.duration < 300.0
    assert any("is gone" in f.message for f in record.findings)
    assert "was commanded to stop" in (folder / "run.log").read_text()
    page.get_by_text("Not armed").wait_for()


# Analyse, compare, campaigns.

DRAG = """(factor) => {
    const plot = document.querySelector(".hm-picture"), layout = plot._fullLayout;
    const k = layout.shapes.findIndex((s) => s.name === "bandwidth_phase90");
    const x = layout.xaxis2, y = layout.yaxis2, box = plot.getBoundingClientRect();
    const at = layout.shapes[k].x0;
    const where = (f) => box.left + x._offset + x.d2p(f);
    return [where(at), where(factor * at), box.top + y._offset + 0.3 * y._length];
}"""


@pytest.mark.browser
def test_a_foreign_file_is_dropped_identified_read_by_eye_and_reported(page, served, tmp_path):
    record = recorded()
    u, y = record.inputs[0].values, record.outputs[0].values
    rows = "\n".join(f"{k / 200};{a};{b}" for k, (a, b) in enumerate(zip(u, y, strict=True)))
    file = tmp_path / "bench log.txt"
    file.write_text(f"# rig 7\ntime [s];kommando [deg];{SCRIPT}\n{rows}\n")
    go(page, served, "analyse")
    page.set_input_files("input[type=file]", file)
    page.get_by_role("combobox", name="Outputs").wait_for()
    page.locator(".q-chip").filter(has_text=SCRIPT).wait_for()  # as proposed
    page.get_by_role("button", name="Identify").click()
    line = page.get_by_role("row", name=re.compile("^Bandwidth, −90° [0-9]"))
    line.wait_for()
    automatic = float(line.get_by_role("cell").nth(1).inner_text().split()[0])
    assert automatic == pytest.approx(1.534, abs=0.01)
    page.wait_for_selector(".hm-picture[data-drawn]")
    assert page.evaluate("window.hacked") is None
    assert page.locator("main img").count() == 0
    assert page.get_by_text(SCRIPT).first.is_visible()

    # The line at −90° is dragged to twice the frequency: a third of a decade on a logarithmic axis.
    page.locator(".hm-picture").first.scroll_into_view_if_needed()
    x0, x1, height = page.evaluate(DRAG, 2.0)
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

    page.get_by_label("Delay by hand (s)").fill("0.15")
    page.get_by_text("0.15, by hand").wait_for()
    with page.expect_download() as download:
        page.get_by_role("button", name="Report").click()
    text = download.value.path().read_text(encoding="utf-8")
    assert "by hand: −90° bandwidth" in text
    assert SCRIPT not in text
    page.reload()
    page.get_by_text("0.15, by hand").wait_for()


LEGEND = """() => {
    const plot = document.querySelector('.hm-picture'), room = plot.getBoundingClientRect();
    const foot = plot.querySelector('.legend').getBoundingClientRect().bottom;
    return [foot, room.top + plot._fullLayout._size.t];
}"""
PANEL = "() => document.querySelector('.hm-picture')._fullLayout._size"
NAMES = """() => [...document.querySelectorAll('.hm-picture')].flatMap((plot) => {
    const room = plot.getBoundingClientRect();
    const words = [...plot.querySelectorAll('.shape-label, .annotation, .g-xtitle, .g-ytitle')];
    const boxes = words.map((w) => [w.textContent, w.getBoundingClientRect()]);
    const beyond = (b) => b.left < room.left - 1 || b.right > room.right + 1
        || b.top < room.top - 1 || b.bottom > room.bottom + 1;
    const out = boxes.filter(([, b]) => b.width && beyond(b)).map(([t]) => `${t} is cut`);
    const cursors = [...plot.querySelectorAll('.shape-label')];
    for (const cursor of cursors) for (const [t, b] of boxes) {
        const a = cursor.getBoundingClientRect();
        if (t !== cursor.textContent && b.width && a.left < b.right && b.left < a.right
            && a.top < b.bottom && b.top < a.bottom) out.push(`${cursor.textContent} over ${t}`);
    }
    return out;
})"""


INK = """(button) => {
    const of = (e) => getComputedStyle(e);
    return [of(button).color, of(button.closest(".q-uploader__header")).backgroundColor];
}"""


@pytest.mark.browser
def test_the_button_that_chooses_a_file_is_seen_and_each_doubt_is_said_once(page, served, tmp_path):
    record = recorded()
    u, y = record.inputs[0].values, record.outputs[0].values
    rows = "\n".join(f"{k / 200},{b},{a}" for k, (a, b) in enumerate(zip(u, y, strict=True)))
    (tmp_path / "swapped.csv").write_text(f"time,u,y\n{rows}\n")
    go(page, served, "analyse")
    page.get_by_text("To make one, design a test first.").wait_for()
    choose = page.get_by_role("button", name="Choose a file")
    ink, ground = choose.evaluate(INK)
    assert ink != ground
    page.set_input_files("input[type=file]", tmp_path / "swapped.csv")
    page.get_by_role("combobox", name="Outputs").wait_for()
    page.locator(".q-uploader__list > *").wait_for(state="detached")
    page.get_by_role("button", name="Identify").click()
    verdict = page.get_by_role("region", name="Verdict")
    verdict.get_by_text("Use with care").wait_for()
    said = verdict.inner_text()
    assert said.count("the columns are swapped") == 1
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": y}, {"y": u}, fs=200.0)).pairs[0]
    doubts = [typeset(w.message) for w in pair.warnings if w.severity == "doubt"]
    assert len(doubts) > 3
    assert [said.count(doubt) for doubt in doubts] == [1] * len(doubts)
    page.get_by_text("−90°: no value, drag to set").wait_for()
    page.get_by_text("± ? means that no error bar").wait_for()


@pytest.mark.browser
def test_a_narrower_window_keeps_the_height_of_plots_and_paper_has_no_controls(page, served):
    save(recorded(), served.runs / "narrow.h5")
    wish = Analysis(file="narrow.h5", inputs=("u",), outputs=("y",))
    go(page, served, "analyse", desk_of(served, Desk(name=secrets.token_hex(8), analysis=wish)))
    page.wait_for_selector(".hm-picture[data-drawn]")
    page.wait_for_function("() => [...document.querySelectorAll('.hm-picture')]"
                           ".every((p) => p.dataset.drawn)")  # fmt: skip
    wide = page.evaluate(PANEL)
    assert page.evaluate(NAMES) == []
    page.set_viewport_size({"width": 390, "height": 800})
    page.wait_for_function("() => document.querySelector('.hm-picture')._fullLayout.width < 390")
    page.wait_for_timeout(1500)
    assert page.evaluate(NAMES) == []
    assert page.evaluate(PANEL)["h"] == pytest.approx(wide["h"], abs=3.0)
    page.set_viewport_size({"width": 1280, "height": 800})
    page.wait_for_function("() => document.querySelector('.hm-picture')._fullLayout.width > 600")
    page.wait_for_timeout(1500)
    legend, panel = page.evaluate(LEGEND)
    assert legend <= panel
    page.emulate_media(media="print")
    for control in ("nav", "main button", "main input", ".q-uploader", ".modebar"):
        assert not [c for c in page.locator(control).all() if c.is_visible()], control
    assert page.get_by_text("Record: narrow.h5").is_visible()


def test_a_file_too_large_is_refused_and_a_hostile_name_stays_inside(page, served):
    go(page, served, "analyse")
    before = {p for p in served.runs.parent.rglob("*") if p.is_file()}
    page.set_input_files(
        "input[type=file]", {"name": "big.csv", "mimeType": "text/csv", "buffer": b"0" * 1_200_000}
    )
    page.get_by_text("more than 1 MB").wait_for()
    page.set_input_files(
        "input[type=file]",
        {"name": "<script>..\\alert(1).csv", "mimeType": "text/csv", "buffer": b"t,u,y\n"},
    )
    wait_until(lambda: list((served.runs / "uploads").glob("alert*")), page=page)
    close = page.get_by_role("button", name="Close").last  # it can be read on its ground
    assert close.evaluate("(e) => getComputedStyle(e).color") == "rgb(255, 255, 255)"
    new = {p for p in served.runs.parent.rglob("*") if p.is_file()} - before
    assert all(served.runs in p.parents for p in new)
    assert not any("<" in p.name or p.name == "big.csv" for p in new)


@pytest.mark.browser
def test_two_runs_are_compared_and_held_against_a_specification(page, served):
    for k, delay in enumerate((0.15, 0.12), start=1):
        (served.runs / f"unit{k}").mkdir()
        save(recorded(delay, rng=k), served.runs / f"unit{k}" / "run.h5")
    go(page, served, "runs")
    for k in (1, 2):
        page.get_by_label(f"Choose unit{k}/run.h5").click()
        page.wait_for_selector(f"[aria-label='Choose unit{k}/run.h5'][aria-checked=true]")
    page.get_by_label("Specification").fill("delay < 0.13")
    page.get_by_role("button", name="Compare those chosen").click()
    page.get_by_text("Bode plots over each other").wait_for()
    cells = page.get_by_role("row", name=re.compile("^Delay, pure")).get_by_role("cell")
    values = [float(t.split()[0]) for t in cells.all_inner_texts()[1:]]
    assert values == pytest.approx([0.15, 0.12], abs=1e-3)
    page.get_by_role("row", name=re.compile("unit1.*fail")).wait_for()  # without looking again
    assert page.get_by_role("row", name=re.compile("unit2.* ok ok ")).count() == 1
    page.get_by_label("Specification").fill("delay < 0.2")
    page.get_by_role("button", name="Read the folder again").click()
    page.get_by_role("row", name=re.compile("unit1.* ok ok ")).wait_for()
    page.get_by_label("Only those with").fill("name = *unit9*")
    page.get_by_role("button", name="Read the folder again").click()
    page.get_by_text("No run meets this condition.").wait_for()


@pytest.mark.browser
def test_a_campaign_names_no_code_is_stopped_and_resumed(page, served):
    code = PLAN.replace('kind = "sensor"', 'kind = "python"\nentry = "os:system"')
    code = "\n".join(line for line in code.splitlines() if not line.startswith("sensor ="))
    desk = Desk(name=secrets.token_hex(8), campaign=Campaign(plan=code, out="../study one"))
    go(page, served, "campaign", desk_of(served, desk))
    page.get_by_role("button", name="Start or resume").click()
    page.get_by_text("may not name code").first.wait_for()
    assert not (served.runs / "study one").exists()
    page.get_by_role("textbox", name="The plan").fill(PLAN)
    wait_until(lambda: 'kind = "sensor"' in desk_text(served, desk.name), page=page)
    page.get_by_role("button", name="Start or resume").click()
    cases = served.runs / "study one" / "cases"
    wait_until(lambda: list(cases.glob("*.json")), page=page)
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("start it again to go on").wait_for()
    first = {p.name: p.stat().st_mtime_ns for p in cases.glob("*.json")}
    page.reload()
    page.get_by_role("button", name="Start or resume").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="study.json").click()
    study = json.loads(download.value.path().read_text(encoding="utf-8"))
    assert 0 < len(first) < len(study["rows"]) == 10
    assert all((cases / name).stat().st_mtime_ns == t for name, t in first.items())
    page.get_by_role("button", name="demo", exact=True).click()
    wait_until(lambda: desk_text(served, desk.name) != PLAN, page=page)
    page.get_by_role("button", name="Restore your own plan").click()
    wait_until(lambda: desk_text(served, desk.name) == PLAN, page=page)


def desk_text(served, name):
    """The plan as the desk keeps it."""
    return Desks(served.runs / ".workbench").get(name).campaign.plan


@pytest.mark.browser
def test_nothing_is_lost_by_a_reload_and_a_second_window_gets_a_desk_of_its_own(
    page, served, window
):
    save(recorded(), served.runs / "kept.csv")
    desk = Desk(name=secrets.token_hex(8), analysis=Analysis(file="kept.csv", alpha=2.0))
    go(page, served, "analyse", desk_of(served, desk))
    page.get_by_label("To (s)").fill("8")
    page.get_by_label("To (s)").press("Tab")
    other = window()
    go(other, served, "analyse", desk.name)
    other.wait_for_url(lambda url: desk.name not in url)
    other.get_by_label("To (s)").fill("5")
    other.get_by_label("To (s)").press("Tab")
    page.reload()
    page.wait_for_function("() => document.querySelector('[aria-label=\"To (s)\"]')?.value === '8'")
    assert desk.name in page.url


# Keys and names.

STOPS = """() => [...document.querySelectorAll(
        "a[href], button, input, textarea, summary, [tabindex]")]
    .filter((e) => e.tabIndex >= 0 && !e.disabled && e.type !== "file" && e.checkVisibility())
    .map((e, k) => { e.dataset.stop = k; return e.outerHTML.slice(0, 200); })"""


SETTLED = """(most) => {
    const pictures = [...document.querySelectorAll(".hm-picture")];
    const count = document.querySelectorAll("main *").length;
    const same = count === window.counted;
    window.counted = count;
    return same && pictures.length >= most && pictures.every((one) => one.dataset.drawn);
}"""


def heard(line):
    """Role and name of what has the focus, as a screen reader is told them, and its number."""
    line.send("DOM.getDocument", {"depth": 0})
    here = line.send("Runtime.evaluate", {"expression": "document.activeElement"})["result"]
    asked = {"objectId": here["objectId"], "fetchRelatives": False}
    node = line.send("Accessibility.getPartialAXTree", asked)["nodes"][0]
    stop = line.send("Runtime.evaluate", {"expression": "document.activeElement.dataset.stop"})
    return (
        node["role"]["value"],
        node.get("name", {}).get("value", ""),
        stop["result"].get("value"),
    )


@pytest.mark.browser
def test_every_control_is_reached_by_tab_in_its_order_and_has_a_name(page, served):
    save(recorded(), served.runs / "heard.csv")
    analysis = Analysis(file="heard.csv", inputs=("u",), outputs=("y",))
    desk = desk_of(served, Desk(name=secrets.token_hex(8), analysis=analysis))
    ready = {"design": "Error bars", "analyse": "Delay by hand (s)", "runs": "Choose heard.csv"}
    line = page.context.new_cdp_session(page)
    for name in ("design", "check", "run", "analyse", "runs", "campaign"):
        go(page, served, name, desk)
        if name in ready:
            page.get_by_label(ready[name]).first.wait_for()
        page.wait_for_function(SETTLED, arg=3 if name == "design" else 0, polling=1000)
        wanted = page.evaluate(STOPS)
        reached = []
        for _ in wanted:
            page.keyboard.press("Tab")
            role, words, stop = heard(line)
            assert words, f"{name}: {role} without a name at {wanted[int(stop or 0)]}"
            reached.append(int(stop))
        assert reached == list(range(len(wanted))), name
        assert len(wanted) > 10
    go(page, served, "design")
    page.get_by_role("slider", name="Amplitude").press("ArrowLeft")
    page.get_by_text("0.99", exact=True).wait_for()
