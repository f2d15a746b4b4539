"""The strip chart: what is drawn is what was commanded and measured."""

import io
import os
import re

import numpy as np
import pytest

from hmpim.cli.strip import Strip, drawn
from hmpim.experiment import run
from hmpim.rigs import Samples, Sensor
from hmpim.stimulus import Limits, design

SWEEP = design(band=(0.3, 4), duration=4, fs=200, limits=Limits(position=10, unit="deg"))


def dots(lines):
    """Rows and columns of dots, from top left."""
    weights = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
    return np.array(
        [
            [(ord(c) - 0x2800) & weights[i][j] > 0 for c in line for j in (0, 1)]
            for line in lines
            for i in range(4)
        ]
    )


def test_a_drawing_is_the_curve():
    t = np.arange(2000) / 1000
    wave = np.sin(2 * np.pi * 1.5 * t)
    picture = dots(drawn(Samples(time=t, values=wave), end=2.0, span=2.0, size=(40, 4)))
    assert picture.shape == (16, 80)
    middle = np.array([np.flatnonzero(column).mean() for column in picture.T])
    expected = (1 - np.sin(2 * np.pi * 1.5 * (np.arange(80) + 0.5) / 40)) / 2 * 15
    assert np.abs(middle - expected).max() < 1.0


def test_what_is_not_there_is_not_drawn():
    nothing = Samples(time=np.empty(0), values=np.empty(0))
    assert not dots(drawn(nothing, end=1.0, span=1.0, size=(8, 2))).any()
    half = Samples(time=np.array([0.1, 0.2, 5.0]), values=np.array([1.0, np.nan, 9.0]))
    assert dots(drawn(half, end=1.0, span=1.0, size=(8, 2))).sum() == 1


def test_the_run_is_seen_and_left_in_the_terminal():
    out = io.StringIO()
    ticks = iter(np.arange(10_000) * 0.05)
    record = run(
        Sensor(delay=0.1875, noise_std=0.0),
        SWEEP,
        subscribers=[Strip(out, clock=lambda: next(ticks))],
    )
    screens = out.getvalue().split("\x1b[9A")
    assert 40 < len(screens) < 70  # every fourth of 200 blocks
    last = [line.removeprefix("\r\x1b[K") for line in screens[-1].split("\n")[:-1]]
    assert [line.split()[0] for line in last if line[0] != " "] == ["u", "y"]
    assert last[-1].split() == ["5.2", "of", "5.2", "s"]
    command, response = (dots([line[2:66] for line in last[k : k + 4]]) for k in (0, 4))
    late = round(0.1875 / 3.0 * 128)
    agree = np.mean(command[:, 40:-late] == response[:, 40 + late :])
    assert agree > 0.9 > np.mean(command[:, 40:-late] == response[:, 40:-late])
    assert f"{record.outputs[0].values[-1]:+10.3f}" in screens[-1]


@pytest.mark.parametrize(("columns", "rows"), [(60, 24), (30, 24), (80, 4), (0, 0)])
def test_no_line_is_wrapped_and_none_leaves_the_screen(monkeypatch, columns, rows):
    """What is drawn over must stand where it was drawn: a terminal that says 0 is a usual one."""
    size = os.terminal_size((columns, rows))
    monkeypatch.setattr(os, "get_terminal_size", lambda _: size)
    out = io.StringIO()
    monkeypatch.setattr(out, "fileno", lambda: 2)
    sensor = Sensor(delay=0.01, input_name="elevation.command", output_name="elevation.position")
    run(sensor, SWEEP, subscribers=[Strip(out)])
    lines = re.sub(r"\x1b\[\d*[AK]|\r", "", out.getvalue()).splitlines()
    assert max(map(len, lines)) < (columns or 80)
    assert max(int(up) for up in re.findall(r"\x1b\[(\d+)A", out.getvalue())) < (rows or 24)
    assert any(line.startswith("elevat") and max(map(ord, line)) > 0x2800 for line in lines)
