"""The page of a batch, and what each record is held against."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

import hmpim
from batch_support import FS, write_rows
from hmpim.batch import study
from hmpim.batch.expect import held_against, read_bound
from hmpim.batch.pictures import distribution, groups, sequence
from hmpim.batch.rows import PARAMETERS
from hmpim.batch.run import Cluster
from hmpim.batch.study import _order, outliers, write_study
from hmpim.batch.summary import summary_of
from hmpim.plots.draw.frames import ticks
from hmpim.report.study import StudyPage, render_study


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    write_rows(folder / "fleet.parquet")
    here = Cluster(workers=0)
    return hmpim.batch(folder / "fleet.parquet", out=folder / "out", fs=FS, cluster=here)


def test_bounds_are_held_against_intervals(table, tmp_path):
    """Gains 1 to 8, each known to a hundredth: one interval holds the bound."""
    outcomes = write_study(
        table, tmp_path / "study.html", bounds=[read_bound("scale_factor <= 5.0")], by=["bench"]
    )
    (found,) = outcomes
    assert found.passed + found.unsure == 5
    assert (found.failed, found.untold) == (3, 0)
    page = (tmp_path / "study.html").read_text(encoding="utf-8")
    assert "3 outside the specification" in page
    assert page.index("<span>Specification") < page.index("<span>Results")
    assert "Scale factor by bench" in page
    assert ">nan" not in page
    assert summary_of(table).verdicts["ok"] + summary_of(table).verdicts.get("doubtful", 0) == 8


def test_bounds_that_intervals_hold_are_undecided_and_not_met(table, tmp_path):
    def page(bound):
        (found,) = write_study(table, tmp_path / "study.html", bounds=[read_bound(bound)])
        assert found.failed == 0
        return found, (tmp_path / "study.html").read_text(encoding="utf-8")

    found, met = page("scale_factor < 9.0")
    assert (found.passed, "All bounds are met." in met) == (8, True)
    assert 'class="verdict ok"' in met
    largest = float(np.max(table.to_arrow(["scale_factor"]).column(0).to_numpy()))
    found, open_ = page(f"scale_factor < {largest!r}")
    assert (found.passed, found.unsure) == (7, 1)
    assert "None is outside the specification. 1 undecided" in open_
    assert "All bounds are met" not in open_
    assert '<td class="pass">' not in open_
    assert 'class="verdict doubtful"' in open_


def test_moments_are_no_groups_and_days_are():
    said = {"created": [f"2026-03-01T10:0{k // 3}:00" for k in range(6)]}
    said |= {"day": [f"2026-03-0{1 + k // 3}" for k in range(6)]}
    told = Told(**{f"meta_{name}": words for name, words in said.items()})
    assert list(study._labels(told, ())) == ["day"]
    assert list(study._labels(told, ("created",))) == ["created"]  # unless they are asked for


def test_names_below_an_axis_keep_what_sets_them_apart():
    values = {f"at a level of {k}.5 deg": np.ones(3) for k in range(3)}
    (panel,) = groups(values, name="delay", unit="s", by="test").panels
    assert [words for _, words in panel.x.ticks] == [f"…el of {k}.5 deg" for k in range(3)]


def test_a_drift_is_told_in_words_and_a_few_outliers_make_none():
    day, rng = np.arange(2000.0), np.random.default_rng(5)
    values = rng.standard_normal(2000)
    values[-9:] += 300.0
    assert study.trend(day, values) is None
    _, low, high = study.trend(day, values - 0.01 * day)
    assert low < -0.01 < high < low + 4e-4
    told = study._drift((-0.01, -0.0102, -0.0099), "Hz a day")
    assert told == "It falls by 0.01 Hz a day (99 % interval 0.0099 to 0.0102)."
    assert study.trend(np.zeros(50), values[:50]) is None  # all at once


def test_records_without_figures_are_named():
    names = [f"/fleet/unit{k}.csv" for k in range(5)]
    reasons = ["it is empty", None, "it is noise", "it is empty", None]
    nothing = {f"{name}{end}": [None] * 5 for name in PARAMETERS for end in ("", "_doubtful")}
    told = Told(key=names, record=names, verdict=["ok"] * 5, reason=reasons, **nothing)
    found = summary_of(told)
    assert [(f.reason, f.count) for f in found.failures] == [("it is empty", 2), ("it is noise", 1)]
    (grid,) = study._failures(told, found)
    assert grid.rows == (("unit0.csv", "2", "it is empty"), ("unit2.csv", "1", "it is noise"))


def test_a_bound_of_another_dimension_is_refused_before_any_work():
    with pytest.raises(
        hmpim.HmpimError, match="'delay < 5 mm': unit 'mm' cannot be turned into 's'"
    ):
        read_bound("delay < 5 mm")
    assert read_bound("bias < 5 mm").unit == "mm"  # its unit is that of the output


class Told:
    """A table of a few columns."""

    def __init__(self, **columns):
        self._columns = columns
        self.metadata = tuple(n.removeprefix("meta_") for n in columns if n.startswith("meta_"))

    def to_arrow(self, names):
        import pyarrow as pa

        every = {name: pa.array(self._columns[name]) for name in names}
        return pa.table({k: v.cast("double") if v.type == "null" else v for k, v in every.items()})


def test_a_date_that_somebody_gave_goes_before_the_file_s_own():
    made = [f"2026-03-0{k}T10:00:00" for k in (1, 2, 5)]
    files = ["2026-11-22T10:00:00"] * 3
    every = np.arange(3)
    places, along = study._order(Told(meta_created=files, meta_date=made), every)
    assert (places.tolist(), along) == ([0.0, 1.0, 4.0], "Days since the first (date)")
    files = [f"2026-11-22T10:0{k}:00" for k in (0, 1, 9)]
    places, along = study._order(Told(meta_created=files), every)
    assert (places.tolist(), along) == ([0.0, 1.0, 9.0], "Minutes since the first (created)")


def test_dates_are_found_under_any_name_and_serial_numbers_are_none():
    days = [f"2026-03-0{k} 10:00:00" for k in (1, 2, 5)]
    told = Told(meta_serial=["20260101", "20260102", "20260109"], meta_start=days)
    places, along = study._order(told, np.arange(3))
    assert (places.tolist(), along) == ([0.0, 1.0, 4.0], "Days since the first (start)")


def test_records_are_in_the_order_in_which_people_count():
    told = Told(record=["fleet.parquet#10", "fleet.parquet#9", "fleet.parquet#100"])
    places, along = study._order(told, np.arange(3))
    assert (places.tolist(), along) == ([1.0, 0.0, 2.0], "Record, by name")
    every = study._names(told, np.arange(3))
    assert every == ("fleet.parquet#9", "fleet.parquet#10", "fleet.parquet#100")


def test_records_are_named_without_their_common_folder_and_in_full_on_pointing():
    names = [f"/data/fleet/rig-{1 + k % 2}/r{k}.csv" for k in range(40)]
    values = np.random.default_rng(1).standard_normal(40)
    values[5] = 100.0
    columns = {"d": values, "d_std": np.ones(40), "d_low": values - 2, "d_high": values + 2}
    told = Told(record=names, **columns)
    _, (grid,) = study._standing_out(told, SimpleNamespace(name="d"), values, np.arange(40))
    assert grid.rows[0][0] == "rig-2/r5.csv"
    page = StudyPage(
        title="", description="", headline="", met=None, grids=(grid,), sections=(), facts=()
    )
    assert '<th scope="row" title="/data/fleet/rig-2/r5.csv">rig-2/r5.csv' in render_study(page)
    assert study._folder(told) == "/data/fleet/"
    for records, folder in (
        (["fleet.parquet#1", "fleet.parquet#10"], ""),
        (["s3://bin/a/1.csv", "s3://bin/ab/2.csv"], "s3://bin/"),
        (["a/1.csv", "/data/1.csv"], ""),
        (["a/1.csv"], "a/"),
    ):
        assert study._folder(Told(record=records)) == folder


def test_records_a_sample_apart_do_not_stand_out_where_most_are_equal():
    """A delay read to whole samples: the deviation is that of its rounding, and not zero."""
    values = np.array([0.045] * 101 + [0.040] * 19)
    std, name = 0.005 / np.sqrt(12), [f"r{k}" for k in range(120)]
    half = 1.96 * std
    columns = {"d": values, "d_std": np.full(120, std), "d_low": values - half}
    told = Told(record=name, **columns, d_high=values + half)
    row = SimpleNamespace(name="d")
    said, _ = study._standing_out(told, row, values, np.arange(120))
    assert said[0].startswith("No record stands out")
    values[7] = 0.1
    said, (grid,) = study._standing_out(told, row, values, np.arange(120))
    assert said[0].startswith("1 record lies")
    assert [cells[0] for cells in grid.rows] == ["r7"]


def test_an_interval_over_several_models_has_the_error_bar_of_the_likeliest():
    table = Told(d=[5.0, 5.0], d_std=[0.1, None], d_low=[4.8, 2.0], d_high=[5.2, 5.196])
    assert study._own_errors(table, "d") == pytest.approx([0.1, 0.1])


def test_units_of_bounds(table):
    """Delays of 20 ms."""
    assert held_against(table, read_bound("delay > 1ms")).passed == 8
    assert held_against(table, read_bound("delay > 0.03 s")).failed == 8
    with pytest.raises(hmpim.HmpimError, match="'delay > 1Hz'"):
        held_against(table, read_bound("delay > 1Hz"))
    with pytest.raises(hmpim.HmpimError, match="is not a bound"):
        read_bound("delay about 3")


@pytest.mark.few(200)
def test_equal_units_seldom_stand_out(seeds):
    """One fleet in a hundred, by chance; the median's own scatter adds a little."""
    alarms = 0
    for seed in range(seeds):
        away, limit = outliers(np.random.default_rng(seed).standard_normal(500))
        alarms += bool((away > limit).any())
    assert alarms <= 0.01 * seeds + 4 * np.sqrt(0.01 * seeds)


@pytest.mark.parametrize(
    ("step", "said", "last"),
    [(86_400.0, "Days since the first (created)", 3.0), (40.0, "Minutes since", 2.0),
     (0.01, "Record, by name", 3.0)],
)  # fmt: skip
def test_records_stand_in_the_order_of_their_making_where_the_stamps_tell_it(step, said, last):
    import pyarrow as pa

    begin = datetime(2026, 1, 1, tzinfo=UTC)
    stamps = [(begin + timedelta(seconds=step * k)).isoformat() for k in range(4)]
    columns = {"meta_created": stamps, "record": ["a", "b", "c", "d"]}
    table = SimpleNamespace(
        metadata=("created",), to_arrow=lambda names: pa.table({n: columns[n] for n in names})
    )
    places, along = _order(table, np.arange(4))
    assert along.startswith(said)
    assert places.tolist() == pytest.approx([0.0, last / 3, 2 * last / 3, last])


@pytest.mark.parametrize("count", [1, 4, 10, 11, 70, 1000, 90_000])
def test_the_first_and_the_last_record_are_seen_and_ticks_are_few(count):
    names = tuple(f"u{k:05d}.csv" for k in range(count))
    places = np.arange(float(count))
    figure = sequence(places, places, name="delay", unit="s", along="Record, by name", names=names)
    x = figure.panels[0].x
    assert (x.low, x.high) == (-0.5, count - 0.5)
    shown = ticks(x, (x.low, x.high))
    assert len(shown) == min(count, 10) if count <= 10 else 5 <= len(shown) <= 10
    if count <= 10:
        assert [words for _, words in shown] == list(names)
    else:
        assert all(at + 1 == int(words) for at, words in shown)  # its number, from 1


def test_days_have_room_at_both_ends():
    x = (
        sequence(np.array([0.0, 30.0]), np.ones(2), name="delay", unit="s", along="Days")
        .panels[0]
        .x
    )
    assert x.low < 0.0
    assert x.high > 30.0


def test_records_are_counted_in_whole_numbers():
    (panel,) = distribution(np.array([1.0, 1.0, 2.0]), name="delay", unit="s").panels
    assert [words for _, words in ticks(panel.y, (0.0, 2.2))] == ["0", "1", "2"]


def test_values_that_differ_by_rounding_alone_are_drawn_as_equal():
    """A step of rounding is found exactly; ticks 1e-18 apart all read 0.01."""
    values = 0.01 + 1e-18 * np.array([0.0, 2.0, 0.0, 4.0])
    assert np.ptp(values) > 0.0
    (bars,) = distribution(values, name="quantization_step", unit="deg").panels
    assert bars.items[0].x[-1] - bars.items[0].x[0] > 1e-6
    (along,) = sequence(
        np.arange(4.0), values, name="quantization_step", unit="deg", along="Record"
    ).panels
    assert np.ptp(along.items[0].y) == 0.0
