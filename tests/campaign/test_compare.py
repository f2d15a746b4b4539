"""What a figure says of its cases: readings that noise does not pull down, words with numbers."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.campaign import parse_plan, read_plan, run_campaign, shipped_plan
from hmpim.campaign.compare import findings
from hmpim.campaign.crossing import first_crossing, samples_bandwidth
from hmpim.campaign.grids import PARAMETERS, axis_grid, case_grid
from hmpim.campaign.pictures import section_pictures
from hmpim.campaign.study import Reading, make_study
from hmpim.campaign.write import study_page, write_study
from hmpim.report.numbers import NOT_DETERMINED
from hmpim.rigs.table import AXES
from tests_support import in_studies

F = np.arange(1.0, 60.0, 0.1)


def response(*, seed=0, std=0.0):
    """Second order, 30 Hz, and 2 ms of delay; noise as large at each frequency as stated."""
    s = 1j * F / 30.0
    exact = np.exp(-2j * np.pi * F * 2e-3) / (1.0 + 1.4 * s + s * s)
    rng = np.random.default_rng(seed)
    noise = std / np.sqrt(2.0) * (rng.standard_normal((2, F.size)) * [[1.0], [1.0j]]).sum(axis=0)
    z = exact + noise
    stds = [max(std, 1e-6)] * F.size
    return {"frequency": F.tolist(), "real": z.real.tolist(), "imag": z.imag.tolist(), "std": stds}


def truth():
    fine = np.arange(10.0, 30.0, 1e-4)
    lag = 2 * np.pi * fine * 2e-3 + np.arctan2(1.4 * fine / 30.0, 1.0 - (fine / 30.0) ** 2)
    return fine[np.argmax(lag > np.pi / 2)]


@pytest.mark.parametrize("near", [0.8, 1.0, 1.3])
def test_crossing_is_found_from_where_it_is_looked_for(near):
    assert samples_bandwidth(response(), near=near * truth()) == pytest.approx(truth(), rel=1e-3)


def test_where_nothing_tells_where_to_look_the_response_does():
    assert first_crossing(response()) == pytest.approx(truth(), abs=0.1)
    near = first_crossing(response(seed=1, std=0.02))
    found = samples_bandwidth(response(seed=1, std=0.02), near=near)
    assert found == pytest.approx(truth(), rel=0.02)
    assert first_crossing(response(std=2.0)) is None  # nowhere clear
    low = {name: values[:50] for name, values in response().items()}  # to 6 Hz: not so late yet
    assert first_crossing(low) is None


def test_noise_in_the_phase_does_not_pull_the_crossing_down():
    """The first crossing of a noisy phase lies too low, as in the paper's Fig. 24."""
    found = [
        samples_bandwidth(response(seed=k, std=0.1), near=1.1 * truth()) / truth() - 1.0
        for k in range(40)
    ]
    assert abs(np.mean(found)) < 0.005
    first = []
    for k in range(40):
        z = response(seed=k, std=0.1)
        angle = np.unwrap(np.angle(np.array(z["real"]) + 1j * np.array(z["imag"])))
        first.append(F[np.argmax(angle < -np.pi / 2)] / truth() - 1.0)
    assert np.mean(first) < -0.02


def test_what_is_not_clear_has_no_crossing():
    assert samples_bandwidth(response(std=5.0), near=truth()) is None
    assert samples_bandwidth(response(), near=500.0) is None


FEW = ("roll", "pitch", "elevation")


def demo_plan(name):
    """The demonstration as it is shipped, or of three axes in half the time at half the rate."""
    if name == "shipped":
        return read_plan(shipped_plan("demo"))
    data = tomllib.loads(shipped_plan("demo").read_text(encoding="utf-8"))
    data["stimulus"]["duration"] = 5.0
    data["test"][0]["rates"] = [500.0]
    data["axes"] = {axis: data["axes"][axis] for axis in FEW}
    for axis in data["axes"].values():
        axis["travel"] = 2.0  # in 5 s the limits leave no more
    wanted = data["specification"]
    data["specification"] = [one for one in wanted if one["axis"] in FEW]
    return parse_plan(data)


@pytest.fixture(scope="module", params=["short", *in_studies("shipped")])
def demo(request, tmp_path_factory):
    pytest.importorskip("mujoco", reason="the table needs the extra 'table'")
    folder = tmp_path_factory.mktemp("demo")
    plan = demo_plan(request.param)
    study = make_study(plan, run_campaign(plan, folder))
    write_study(study, folder)
    return study, folder


def test_demo_finds_all_axes_and_shows_them(demo):
    study, folder = demo
    axes = [wish.name for wish in study.plan.axes]
    assert study.met is True
    assert [check.outcome for check in study.checks] == ["pass"] * len(axes)
    assert [row.axis for row in study.rows] == axes
    for row in study.rows:
        assert 0.95 < row.parameters["bandwidth_phase90"].value / row.exact_bandwidth < 1.01
    (section,) = study_page(study).sections
    (picture,) = section.pictures
    labels = [item.label.partition(": −90° at ")[0] for item in picture.figure.panels[0].items]
    noisy = picture.caption.partition("Not drawn")[2]  # what would cover the plot
    assert labels == [axis for axis in axes if axis not in noisy]
    assert len(labels) >= len(axes) - 1
    assert all(" Hz" in item.label for item in picture.figure.panels[0].items)
    wanted = axis_grid(study).columns.index("Specification")
    assert all(row[wanted].endswith(" Hz") for row in axis_grid(study).rows)
    assert study_page(study).doubtful == any(row.verdict != "ok" for row in study.rows)
    assert [grid.caption.split(" ")[0] for grid in section.grids] == ["Couplings"]
    page = (folder / "study.html").read_text(encoding="utf-8")
    # In the table of the axes, and check by check.
    assert page.count('class="pass"') == 2 * len(axes)
    assert "<svg" in page


@pytest.mark.parametrize("axes", [("elevation",), *in_studies((tuple(AXES),))])
def test_all_in_one_fit_have_the_bandwidths_of_each_alone(demo, axes):
    """The rows come of one axis at a time; here all inputs of the raw record are fitted at once."""
    study, folder = demo
    axes = [row.axis for row in study.rows if row.axis in axes]
    (path,) = (folder / "records").glob("*.h5")
    plain = ["static", "first_order", "second_order", "third_order", "second_order_high_pass"]
    record = hmpim.load(path)
    record = record.with_roles(
        inputs=[c.name for c in record.inputs], outputs=[f"{axis}.position" for axis in axes]
    )
    found = hmpim.identify(record, structures=plain)
    assert len(found.pairs) == len(study.rows) * len(axes)
    for row in study.rows:
        if row.axis in axes:
            pair = found[f"{row.axis}.position", f"{row.axis}.command"]
            single = row.parameters["bandwidth_phase90"].value
            assert pair.bandwidth_phase90.value == pytest.approx(single, rel=0.02)
    for pair in found.pairs:
        if pair.input.split(".")[0] != pair.output.split(".")[0]:
            steady = pair.structure != "second_order_high_pass"
            assert not (steady and pair.parameters.scale_factor)  # inertia couples nothing at rest


def test_couplings_stand_beside_the_exact_ones(demo):
    """A true coupling is seen, or bounded: noise makes a gain larger, hardly ever smaller."""
    study, _ = demo
    assert len(study.couplings) == len(study.rows) * (len(study.rows) - 1)
    for c in study.couplings:
        assert 0.0 <= c["exact"] < 0.02
        assert c["gain"] > c["exact"] - 3.0 * c["std"]
        assert c["gain"] < c["exact"] + 4.0 * c["std"]


def test_page_says_how_to_read_it_and_why_a_verdict_is_not_ok(demo):
    study, folder = demo
    page = study_page(study)
    (cases,) = [grid for grid in page.grids if grid.caption.startswith("Every case")]
    assert "behind the hold" in cases.note
    assert "without friction" in cases.note
    assert "Noise (deg)" in cases.columns
    assert "Load" not in cases.columns  # the usual one in every row
    verdicts = [row[cases.columns.index("Verdict")] for row in cases.rows]
    (remarks,) = [grid for grid in page.grids if grid.caption.startswith("Findings of the identif")]
    said = f"{sum(v != 'ok' for v in verdicts)} of {len(study.rows)} verdicts"
    assert said in remarks.caption
    told = {row[0]: int(row[1]) for row in remarks.rows}
    codes = [{w["code"] for w in row.pair["warnings"]} for row in study.rows]
    doubts = [
        {w["code"] for w in row.pair["warnings"] if w["severity"] == "doubt"} for row in study.rows
    ]
    for row in remarks.rows:
        assert int(row[2]) == sum(row[0].replace(" ", "_") in said for said in doubts)
    for code, count in told.items():
        assert count == sum(code.replace(" ", "_") in found for found in codes)
    text = (folder / "study.md").read_text(encoding="utf-8")
    assert remarks.rows[0][-1] in text
    assert remarks.note in text


def test_a_doubtful_figure_is_marked_and_the_others_of_its_row_are_not(demo):
    study, _ = demo
    first, *others = study.rows
    noise = replace(first.parameters["noise_std"], verdict="doubtful")
    first = replace(first, parameters={**first.parameters, "noise_std": noise})
    study = replace(study, rows=(first, *others))
    (cases,) = [g for g in study_page(study).grids if g.caption.startswith("Every case")]
    marked = 0
    for row, cells in zip(study.rows, cases.rows, strict=True):
        shown = dict(zip(cases.columns, cells, strict=True))
        for name, label in PARAMETERS:
            cell = next(text for title, text in shown.items() if title.startswith(label))
            if cell in ("–", NOT_DETERMINED):  # no figure that could be marked
                continue
            assert cell.endswith(" ?") == (row.parameters[name].verdict == "doubtful")
            marked += cell.endswith(" ?")
    assert 0 < marked < len(study.rows) * len(PARAMETERS)


def test_an_earlier_study_of_the_first_schema_is_compared_with(demo, request, tmp_path):
    """It has no verdict for each figure; its values and errors are as they were."""
    _, folder = demo
    data = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    assert data["schema"] == "hmpim/study/2"
    for row in data["rows"]:
        for reading in row["parameters"].values():
            del reading["verdict"]
    before = tmp_path / "study.json"
    before.write_text(json.dumps(data | {"schema": "hmpim/study/1"}), encoding="utf-8")
    plan = demo_plan(request.node.callspec.params["demo"])
    cases = [json.loads(p.read_text(encoding="utf-8")) for p in (folder / "cases").glob("*.json")]
    changes = make_study(plan, cases, earlier=before).changes
    assert len(changes) > 6 * len(cases[0]["pairs"])
    assert not any(change.differs for change in changes)


def test_bins_of_the_record_lie_about_the_estimate(demo):
    """The paper's ratio of spectra, bin by bin, and the local estimate are of one thing.

    Friction, a hundredth of the motion, is in the bins alone.
    """
    _, folder = demo
    (case,) = (folder / "cases").glob("*.json")
    pair = json.loads(case.read_text(encoding="utf-8"))["pairs"][0]
    bins, found = pair["bins"], pair["frequency_response"]
    spacing = np.diff(bins["frequency"])
    assert np.allclose(spacing, spacing[0], rtol=1e-3)
    at = np.array(bins["frequency"])
    seen = (at > 5.0) & (at < 40.0)
    ratio = (np.array(bins["real"]) + 1j * np.array(bins["imag"]))[seen]
    smooth = np.interp(at[seen], found["frequency"], found["real"]) + 1j * np.interp(
        at[seen], found["frequency"], found["imag"]
    )
    off = ratio - smooth
    assert np.sqrt(np.mean(np.abs(off) ** 2)) < 0.05
    assert abs(off.mean()) < 0.02


def test_without_figures_each_test_shows_all_its_cases_by_what_sets_them_apart(tmp_path):
    data = tomllib.loads(shipped_plan("example").read_text(encoding="utf-8"))
    del data["figure"]
    data["stimulus"]["duration"] = 3.0
    plan = parse_plan(data)
    (section,) = study_page(make_study(plan, run_campaign(plan, tmp_path))).sections
    (picture,) = section.pictures
    labels = [item.label.partition(": −90° at ")[0] for item in picture.figure.panels[0].items]
    assert labels == ["inner, 250 Hz", "outer, 250 Hz", "inner, 500 Hz", "outer, 500 Hz"]
    inner, outer = section.found
    assert inner.count("−90° at ") == outer.count("−90° at ") == 2
    assert "(250 Hz); " in inner


@pytest.mark.parametrize(("share", "drawn"), [(0.4, False), (0.6, True)])
def test_a_curve_is_drawn_if_half_of_its_axis_is_known(demo, share, drawn):
    row = demo[0].rows[0]
    f = np.geomspace(0.1, 10.0, 200)
    std = np.where(np.arange(200) < 200 * share, 0.1, 0.5)
    told = {"frequency": f.tolist(), "real": [1.0] * 200, "imag": [0.0] * 200, "std": std.tolist()}
    one = replace(row, pair={**row.pair, "frequency_response": told})
    (figure,) = demo[0].plan.figures
    pictures = section_pictures([row, one], figure, [])
    labels = [item.label for item in pictures[0].figure.panels[0].items]
    assert len(labels) == 1 + drawn
    assert ("Not drawn" in pictures[0].caption) is not drawn


@pytest.mark.parametrize(("compare", "held"), [("modes", True), ("levels", True), ("loads", False)])
def test_a_picture_of_sampled_responses_says_that_its_phase_has_the_hold(demo, compare, held):
    row = demo[0].rows[0]
    (figure,) = demo[0].plan.figures
    (picture, *_) = section_pictures([row], replace(figure, compare=compare), [])
    (label,) = {panel.y.label for panel in picture.figure.panels if panel.row}
    assert (label == "Phase with hold (deg)") is held
    assert ("includes the hold" in picture.caption) is held


def test_an_asymmetric_interval_is_written_with_both_sides(demo):
    study, _ = demo
    row = next(row for row in study.rows if row.axis == "elevation")
    readings = {
        "bandwidth_phase90": Reading(value=6.9223, std=0.0348, unit="Hz", ci95=(6.8911, 6.9905)),
        "delay": Reading(value=0.0079, std=0.0013, unit="s", ci95=(0.0068, 0.0104)),
        "bias": Reading(value=0.1, std=0.01, unit="deg", ci95=(0.08, 0.12)),
    }
    grid = case_grid([replace(row, parameters=readings)], "")
    cells = dict(zip(grid.columns, grid.rows[0], strict=True))
    assert cells["−90° (Hz)"] == "6.922 −0.031 +0.068"
    assert cells["Delay (ms)"] == "7.9 −1.1 +2.5"
    assert (
        "−a +b states how far"
        in case_grid([replace(row, parameters=readings)], "", explained=True).note
    )
    assert cells["Bias (deg)"] == "0.100 ± 0.010"
    (said, *_) = findings([replace(row, parameters=readings)], [], "axes")
    assert said.startswith("elevation: −90° at 6.922 −0.031 +0.068 Hz, 1.1 % below the exact value")


def test_a_positive_figure_whose_error_exceeds_it_is_not_determined(demo):
    row = demo[0].rows[0]
    vague = {
        **row.parameters,
        "natural_frequency": Reading(value=3.0, std=5.0, unit="Hz"),
        "damping_ratio": Reading(value=0.4, std=0.3),
        "bias": Reading(value=0.1, std=0.5, unit="deg"),
    }
    grid = case_grid([replace(row, parameters=vague)], "")
    cells = dict(zip(grid.columns, grid.rows[0], strict=True))
    assert cells["fn (Hz)"] == "not determined"
    assert cells["ζ"] == "0.40 ± 0.30"
    assert cells["Bias (deg)"] == "0.10 ± 0.50"
