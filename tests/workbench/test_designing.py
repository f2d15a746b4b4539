"""Designs behind the page: what is kept, what is solved, what the gentlest saves."""

import base64
from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.plots.stimulus import stimulus_spectrogram
from hmpim.workbench.desks import AxisRow, Model, Wish
from hmpim.workbench.drawn import MOST, changes, drawn, packed, refilled
from hmpim.workbench.work.design import error_rows, stimuli_of
from hmpim.workbench.work.designed import designed, five_axes, spectrum
from tests_support import search_coarsely

WISH = Wish(rows=(AxisRow(name="roll"),), duration=5.0, fs=200.0, model=Model(wanted=2.0))


def test_only_what_changes_a_stimulus_designs_it_anew():
    stimulus = stimuli_of(WISH)[0]
    assert stimuli_of(replace(WISH, alpha=4.0))[0] is stimulus
    assert stimuli_of(replace(WISH, model=Model(delay=0.2)))[0] is stimulus
    assert stimuli_of(replace(WISH, duration=4.0))[0] is not stimulus


def test_a_design_that_would_keep_every_window_waiting_is_refused():
    with pytest.raises(ArgumentError, match=r"1e.08 samples of all axes; at most 1e.07"):
        stimuli_of(replace(WISH, duration=1e5, fs=1000.0))


def test_what_is_solved_is_what_the_stimulus_has():
    found = designed(WISH)
    stimulus = stimuli_of(WISH)[0]
    assert found.solved["extinction"] == stimulus.extinction
    assert 0.0 < found.solved["lead"] < stimulus.duration
    assert designed(replace(WISH, extinction=1.5, lead=0.4)).solved == {}


def test_limits_are_drawn_as_they_are_and_not_as_the_amplitude_uses_them():
    from hmpim.plots import Rule

    half = replace(WISH, rows=(replace(WISH.rows[0], amplitude=5.0),))
    panel = designed(half).motion.panels[0]
    assert sorted(rule.at for rule in panel.of(Rule)) == [-10.0, 10.0]
    assert designed(half).shown.peaks.position <= 5.0


def test_the_gentlest_tells_as_much_as_is_wanted_at_less_acceleration(monkeypatch):
    monkeypatch.setattr("hmpim.workbench.work.design.FAMILIES", ("multisine",))  # one of three
    search_coarsely(monkeypatch)
    gentle = replace(WISH, gentlest=True)
    (softer,), (full,) = stimuli_of(gentle), stimuli_of(WISH)
    assert softer.peaks.acceleration < 0.2 * full.peaks.acceleration
    told = dict(error_rows(gentle, softer))
    assert told["natural_frequency"] <= 0.02 * WISH.model.natural_frequency * (1 + 1e-6)
    assert softer.axis == "roll"
    assert designed(gentle).command.startswith("hmpim gentlest --natural-frequency 10 ")
    with pytest.raises(ArgumentError, match="for one axis, and the design has 5"):
        stimuli_of(replace(gentle, rows=five_axes()))


def test_pictures_go_to_a_page_as_bytes_and_never_as_lists():
    fast = replace(WISH, fs=5000.0)
    figures = [designed(fast).motion, spectrum(fast), stimulus_spectrogram(designed(WISH).shown)]
    for figure in figures:
        drawn = packed(figure.to_plotly(most_points=MOST))
        for trace in drawn["data"]:
            arrays = [trace[key] for key in ("x", "y", "z") if key in trace]
            assert all(len(a) <= 8 for a in arrays if isinstance(a, list))
            counts = [len(a["bdata"]) * 3 // 4 // 8 for a in arrays if isinstance(a, dict)]
            assert trace["type"] == "heatmap" or all(n <= 2 * MOST for n in counts)


def test_a_million_samples_go_thinned_with_their_peaks_and_are_thinned_again_on_zoom():
    from hmpim.plots import Axis, Curve, Figure, Panel

    y = np.sin(np.linspace(0.0, 40.0, 1_000_000))
    y[123_456], y[123_460] = 7.0, 3.0
    curve = Curve(x=np.arange(1e6) / 1000.0, y=y)
    whole = Figure(panels=(Panel(x=Axis(), y=Axis(), items=(curve,)),), alt="A long record.")
    sent = packed(whole.to_plotly(most_points=MOST))["data"][0]
    assert set(sent["x"]) == set(sent["y"]) == {"dtype", "bdata"}
    drawn = whole.to_plotly(most_points=MOST)["data"][0]
    assert drawn["y"].size <= MOST
    assert drawn["y"].max() == 7.0
    (near,) = refilled(whole, 0, 123.4, 123.5)
    seen = np.frombuffer(base64.b64decode(near["y"]["bdata"]))
    assert seen.size == 103  # every sample of a tenth of a second, and one beyond each end
    assert {7.0, 3.0} <= set(seen)
    (half,) = refilled(whole, 0, 100.0, 600.0)
    seen = np.frombuffer(base64.b64decode(half["y"]["bdata"]))
    assert seen.size <= MOST
    assert seen.max() == 7.0
    (again,) = refilled(whole, 0, None, None)
    assert again["y"] == sent["y"]


def test_what_a_page_has_already_is_not_sent_again_and_makes_the_same_picture():
    wish = Wish(duration=2.0, extinction=0.5)
    before, now = (drawn(spectrum(replace(wish, alpha=alpha))) for alpha in (1.5, 1.6))
    sent = changes(now, before)
    assert sent["layout"] is None or sent["layout"] == now["layout"]
    plain, windowed = (trace["kept"] for trace in sent["data"])
    assert plain == ["x", "y"]
    assert "y" not in windowed
    again = [
        {**trace, **{key: old[key] for key in trace["kept"]}}
        for trace, old in zip(sent["data"], before["data"], strict=True)
    ]
    assert [{k: v for k, v in trace.items() if k != "kept"} for trace in again] == now["data"]
    assert changes(now, None)["data"][0]["kept"] == []
