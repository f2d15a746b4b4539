"""Figs 1 and 6: the sensor chain, and what is found of it from which signal; and aliasing."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hmpim.plots.description import Axis, Band, Curve, Figure, Item, Panel, Points, Words
from hmpim.report.figures import Picture
from hmpim.report.paper.chapter import Chapter

__all__ = ["ALIASING", "chains_chapter"]

ALIASING = 26
"""Number of the picture of section IV.D.1, which the paper does not draw; its last is 25."""

_WIDE, _HIGH = 1.75, 0.62  # of a box, half of each
_ROW, _PITCH = 3, 4.2  # boxes of a row, and their distance: their words fit on a phone
_FS, _TONE, _LONG = 20.0, 17.0, 0.6  # Hz, Hz, s


@dataclass(frozen=True, slots=True, kw_only=True)
class _Box:
    """A step of a chain, with its middle."""

    words: tuple[str, ...]
    x: float
    y: float


def chains_chapter() -> Chapter:
    """Make Figs 1 and 6, and the picture of aliasing.

    Examples
    --------
    >>> sorted(chains_chapter().pictures)
    [1, 6, 26]
    """
    return Chapter(pictures={1: _picture_1(), 6: _picture_6(), ALIASING: _aliasing()}, rows=())


def _picture_1() -> Picture:
    chain = (
        ("processing", "delay, τ"),
        ("dynamics,", "fn and ζ"),
        ("scale factor", "and bias"),
        ("noise, σ", ""),
        ("saturation", ""),
        ("data hold", ""),
        ("rounding", ""),
    )
    boxes = [
        _Box(words=words, x=_PITCH * (i % _ROW) + 3.0, y=6.2 - 2.6 * (i // _ROW))
        for i, words in enumerate(chain)
    ]
    items: list[Item] = [_text(0.0, 7.2, "truth"), *_arrow((0.0, 6.2), (boxes[0].x - _WIDE, 6.2))]
    for k, (one, other) in enumerate(pairwise(boxes), start=1):
        if k % _ROW:
            items += _arrow((one.x + _WIDE, one.y), (other.x - _WIDE, other.y))
        else:
            items += _next_row(one, other)
    last = boxes[-1]
    items += _arrow((last.x + _WIDE, last.y), (last.x + 5.0, last.y))
    items += [_text(last.x + _WIDE + 0.2, last.y + 0.45, "measured")]
    for box in boxes:
        items += _box(box)
    words = ", ".join(" ".join(part for part in words if part) for words in chain)
    return Picture(
        key="fig01",
        title="Sensor model example",
        caption="The chain that the package simulates, fits and exports, from the true motion to "
        "the number that is read. The order matters: a held value carries its noise along, and a "
        "clipped one is clipped before it is held and rounded.",
        description=f"Seven steps one after another: {words}.",
        figure=_diagram(items, 13.2, 7.6, "The sensor chain in seven steps."),
    )


def _next_row(one: _Box, other: _Box) -> list[Item]:
    """From the end of a row down and back to the beginning of the next."""
    middle, left = 0.5 * (one.y + other.y), 0.5
    return [
        _line((one.x, one.x), (middle, one.y - _HIGH)),
        _line((left, one.x), (middle, middle)),
        _line((left, left), (other.y, middle)),
        *_arrow((left, other.y), (other.x - _WIDE, other.y)),
    ]


def _picture_6() -> Picture:
    top, bus, rows = 6.8, 4.75, (3.4, 0.9)
    stimulus, unit, joint = (
        _Box(words=words, x=_PITCH * i + 2.3, y=top)
        for i, words in enumerate(
            (("HMPIM", "stimulus"), ("unit", "under test"), ("joint fit,", "error bars"))
        )
    )
    columns = (0.5, 6.7)  # lines that the steps of each column hang on
    named = (
        (("(8) cross-", "correlation"), "delay"),
        (("(9) to (11)", "error"), "bias"),
        (("(12) to (14)", "line, noise"), "scale factor, noise"),
        (("(15) to (25)", "spectra"), "bandwidth, fn, ζ"),
    )
    steps = [
        _Box(words=words, x=columns[i % 2] + 2.9, y=rows[i // 2])
        for i, (words, _) in enumerate(named)
    ]
    branch = 0.5 * (unit.x + joint.x)
    items: list[Item] = [
        *_arrow((stimulus.x + _WIDE, top), (unit.x - _WIDE, top)),
        *_arrow((unit.x + _WIDE, top), (joint.x - _WIDE, top)),
        _text(branch + 0.1, 5.65, "true and"),
        _text(branch + 0.1, 5.15, "measured"),
        _line((branch, branch), (bus, top)),
        _line((columns[0], branch), (bus, bus)),
        *(_line((at, at), (rows[1], bus)) for at in columns),
        *(
            _text(box.x, box.y - 1.05, words, middle=True)
            for box, (_, words) in zip(steps, named, strict=True)
        ),
    ]
    for i, box in enumerate(steps):
        items += _arrow((columns[i % 2], box.y), (box.x - _WIDE, box.y))
    for box in (stimulus, unit, joint, *steps):
        items += _box(box)
    return Picture(
        key="fig06",
        title="Angle measurement sensor model excitation with HMPIM",
        caption="What is found of Fig. 1 from which signals. Below: the paper's steps, one after "
        "another. Right: the joint fit of all parameters to the same two signals, which owes the "
        "steps nothing.",
        description="The stimulus drives the unit under test; true and measured angle go to the "
        "paper's four steps and to the joint fit.",
        figure=_diagram(items, 12.6, 7.5, "From stimulus to parameters."),
    )


def _diagram(items: list[Item], width: float, height: float, alt: str) -> Figure:
    bare = Axis(low=-0.3, high=width + 0.3, ticks=(), grid=False)
    panel = Panel(
        x=bare,
        y=Axis(low=-0.5, high=height, ticks=(), grid=False),
        items=tuple(items),
        legend=False,
    )
    return Figure(panels=(panel,), alt=alt, heights=(0.45 * height,))


def _text(x: float, y: float, words: str, *, middle: bool = False) -> Words:
    return Words(x=x, y=y, text=words, anchor="middle" if middle else "left")


def _line(x: tuple[float, float], y: tuple[float, float]) -> Curve:
    return Curve(x=np.array(x), y=np.array(y), colour="ink", width=1.0)


def _arrow(start: tuple[float, float], end: tuple[float, float]) -> list[Item]:
    """A level arrow to the right."""
    tip, y = end
    half = np.array([0.13, 0.0])
    return [
        _line((start[0], tip - 0.1), (y, y)),
        Band(x=np.array([tip - 0.35, tip]), low=y - half, high=y + half, colour="ink", opacity=1.0),
    ]


def _box(box: _Box) -> list[Item]:
    left, right = box.x - _WIDE, box.x + _WIDE
    low, high = box.y - _HIGH, box.y + _HIGH
    ends = np.array([left, right])
    lines = [words for words in box.words if words]
    step = 0.46
    first = box.y + 0.5 * step * (len(lines) - 1)
    return [
        Band(x=ends, low=np.full(2, low), high=np.full(2, high), colour="input", opacity=0.12),
        *(_line((left, right), (at, at)) for at in (low, high)),
        *(_line((at, at), (low, high)) for at in (left, right)),
        *(_text(box.x, first - step * i, words, middle=True) for i, words in enumerate(lines)),
    ]


def _aliasing() -> Picture:
    fine = np.linspace(0.0, _LONG, 1201)
    taken = np.arange(0.0, _LONG + 1e-9, 1.0 / _FS)
    folded = _FS - _TONE
    tone = np.sin(2.0 * np.pi * _TONE * fine)
    samples = np.sin(2.0 * np.pi * _TONE * taken)
    true_frequency = np.linspace(0.0, 2.5 * _FS, 1001)
    seen = np.abs((true_frequency + 0.5 * _FS) % _FS - 0.5 * _FS)
    over_time = Panel(
        x=Axis(label="Time (s)"),
        y=Axis(label="Signal (–)", low=-1.25, high=1.25),
        items=(
            Curve(x=fine, y=tone, label=f"true, {_TONE:g} Hz", width=0.9),
            Curve(
                x=fine,
                y=-np.sin(2.0 * np.pi * folded * fine),
                label=f"what the samples look like, {folded:g} Hz",
                colour="output",
                dashes="--",
            ),
            Points(x=taken, y=samples, label=f"samples at {_FS:g} Hz", colour="model"),
        ),
    )
    over_frequency = Panel(
        x=Axis(label="True frequency (Hz)"),
        y=Axis(label="Frequency seen (Hz)"),
        items=(
            Curve(x=true_frequency, y=seen),
            Points(
                x=np.array([_TONE]), y=np.array([folded]), colour="output", label="the tone above"
            ),
        ),
        row=1,
    )
    return Picture(
        key="aliasing",
        title="Aliasing",
        caption=f"A tone of {_TONE:g} Hz sampled at {_FS:g} Hz gives the samples of one of "
        f"{folded:g} Hz. All above half the rate folds back below it, and no analysis afterwards "
        "can tell: the rate must be high enough, or a filter must stand before the sampling.",
        description=f"Samples of a {_TONE:g} Hz tone lie on a {folded:g} Hz one; frequency seen "
        "over true frequency is a triangle.",
        figure=Figure(
            panels=(over_time, over_frequency),
            alt="A tone, its samples and its alias; frequency seen over true frequency.",
            heights=(2.2, 2.0),
            share_x=False,
        ),
    )
