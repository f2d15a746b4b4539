"""What a file holds, on a terminal and as one page: a row and a picture for each channel."""

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from hmpim.formats.atomic import write_text
from hmpim.formats.survey import Survey
from hmpim.plots.channels import braille, channel_picture
from hmpim.plots.style import Colour, printable
from hmpim.record import Description, Series
from hmpim.report.svg import inline_svg

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["channels_page", "print_channels", "survey_to_dict"]

_PICTURES = 120  # channels of which a page shows a picture


def survey_to_dict(found: Survey) -> dict[str, Any]:
    """Return a survey as plain JSON values.

    Parameters
    ----------
    found : Survey
        What a file holds.
    """
    return {
        "schema": "hmpim/channels/1",
        "file": found.file,
        "format": found.contents.format,
        "time": found.contents.time,
        "channels": [
            {name: getattr(d, name) for name in Description.__slots__} for d in found.descriptions
        ],
        "unread": dict(found.unread),
        "findings": [f.to_dict() for f in _findings(found)],
        "proposal": {
            "inputs": list(found.proposal.inputs),
            "outputs": list(found.proposal.outputs),
            "reasons": dict(found.proposal.reasons),
        },
        "motions": [{name: getattr(m, name) for name in type(m).__slots__} for m in found.motions],
    }


def print_channels(found: Survey, console: "Console", *, path: str) -> None:
    """Print a table of channels, what is odd, and the proposal.

    Parameters
    ----------
    found : Survey
        What the file holds.
    console : rich.console.Console
        Where.
    path : str
        The file as the person named it, for the command that is proposed.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("Channel", overflow="fold")
    table.add_column("Unit")
    for name in ("Rate", "Span", "Samples", "Gaps"):
        table.add_column(name, justify="right")
    table.add_column("Range", justify="right")
    table.add_column("Picture", no_wrap=True)
    for d, series in zip(found.descriptions, found.series, strict=True):
        table.add_row(
            *(Text(printable(cell)) for cell in (d.name, d.unit or "–", _rate(d), _span(d))),
            str(d.samples),
            _gaps(d),
            _range(d),
            Text(braille(_ordered(series))),
        )
    console.print(f"{printable(found.file)}: {found.contents.format}, {_time_words(found)}")
    console.print(table)
    for line in _lines(found, path):
        # What is to be copied stays on one line.
        console.print(Text(printable(line)), soft_wrap=line.startswith("Try: "))


def _lines(found: Survey, path: str) -> list[str]:
    """What is said below the table."""
    lines = [*_odd(found.descriptions)]
    lines += [f"{f.message[:1].upper()}{f.message[1:]}." for f in _findings(found)]
    lines += _unread(found)
    bare = [d.name for d in found.descriptions if not d.unit]
    if bare:
        more = f" and {len(bare) - 8} others" if len(bare) > 8 else ""
        lines.append(
            f"No unit is stated for {', '.join(bare[:8])}{more}: say it with --unit NAME=UNIT, "
            "such as deg or rad; it is not guessed."
        )
    lines += ["", *_proposed(found, path)]
    return lines


def _proposed(found: Survey, path: str) -> list[str]:
    proposal = found.proposal
    if all(d.problem and not d.restarts for d in found.descriptions):
        return ["No channel can be used as it is, so no input and output are proposed."]
    if not proposal.outputs and any(d.restarts for d in found.descriptions):
        return [
            "Time starts again, so no input and output are proposed; name them with --input "
            "and --output."
        ]
    if not proposal.inputs or not proposal.outputs:
        return ["No input and output stand out; name them with --input and --output.", *_why(found)]
    options = [
        *(f"--input {_quoted(name)}" for name in proposal.inputs),
        *(f"--output {_quoted(name)}" for name in proposal.outputs),
    ]
    sweeps = [m for m in found.motions if m.kind == "sweep"]
    lines = [f"Proposal: {_what(proposal.inputs)} in, {_what(proposal.outputs)} out.", *_why(found)]
    if len(found.motions) > 1 or sweeps:
        lines.append(f"{proposal.inputs[0]!r} makes:")
        lines += [f"  {k}: {m}" for k, m in enumerate(found.motions[:20], start=1)]
    if len(sweeps) > 1:
        options.append("--sweep all")
    return [*lines, f"Try: hmpim identify {_quoted(path)} {' '.join(options)}"]


def _why(found: Survey) -> list[str]:
    return [f"  {name!r}: {reason}" for name, reason in found.proposal.reasons[:40]]


def _what(names: Sequence[str]) -> str:
    return ", ".join(repr(name) for name in names)


def _quoted(name: str) -> str:
    import shlex

    return shlex.quote(name)


def _findings(found: Survey) -> list[Any]:
    return list(
        dict.fromkeys((*found.contents.findings, *(f for s in found.series for f in s.findings)))
    )


def _ordered(series: Series) -> "np.ndarray[Any, np.dtype[np.float64]]":
    """Values with NaN in proportion to the gaps, so that a hole shows where time has one."""
    if series.time is None:
        return series.values
    there = np.isfinite(series.time)
    time, values = series.time[there], series.values[there]
    if time.size < 2 or not time.max() > time.min():
        return values
    count = 4096
    place = ((time - time.min()) / (time.max() - time.min()) * (count - 1)).astype(int)
    if time.size < count:  # fewer samples than columns: no column is a gap for want of one
        return values
    high, low = np.full(count, -np.inf), np.full(count, np.inf)
    good = np.isfinite(values)
    np.maximum.at(high, place[good], values[good])
    np.minimum.at(low, place[good], values[good])
    both = np.stack([low, high], axis=1).ravel()
    both[~np.isfinite(both)] = np.nan
    return both


def _time_words(found: Survey) -> str:
    time = found.contents.time
    if time is not None:
        return f"time from {time!r}"
    stamped = any(series.time is not None for series in found.series)
    return "each sample with its time" if stamped else "no time"


def _rate(d: Description) -> str:
    return "–" if d.rate is None else f"{d.rate:.6g} Hz"


def _span(d: Description) -> str:
    return "–" if d.start is None or d.stop is None else f"{d.start:.6g} to {d.stop:.6g} s"


def _gaps(d: Description) -> str:
    return "–" if not d.gaps else f"{d.gaps} (to {d.longest_gap:.3g} s)"


def _range(d: Description) -> str:
    return "–" if d.low is None or d.high is None else f"{d.low:.4g} to {d.high:.4g}"


def _odd(descriptions: Sequence[Description]) -> list[str]:
    """A sentence for each channel that has something odd; channels that share it share one."""
    said: dict[str, list[str]] = {}
    for d in descriptions:
        parts = []
        if d.missing:
            parts.append(f"{d.missing} of {d.samples} samples missing")
        if d.doubled:
            parts.append(f"{d.doubled} stamps doubled")
        if d.backward and (d.restarts or not d.problem):
            parts.append(f"{d.backward} stamps backward")
        if d.restarts:
            parts.append(
                f"time starts again, so that there are {d.restarts + 1} recordings; take one with "
                "--sweep N, or all with --sweep all"
            )
        if d.jitter:
            parts.append(f"stamps stray by {100 * d.jitter:.2g} % of the interval (r.m.s.)")
        if d.problem and not d.restarts:
            parts.append(f"cannot be used yet: {d.problem}")
        if parts:
            said.setdefault("; ".join(parts), []).append(d.name)
    return [f"{_few(names)}: {words}." for words, names in said.items()]


def _unread(found: Survey) -> list[str]:
    """A sentence for the channels that are no signals, by what they hold."""
    kinds: dict[str, list[str]] = {}
    for name, holds in found.unread:
        kinds.setdefault(holds, []).append(name)
    said = []
    for holds, names in kinds.items():
        kind, _, advice = holds.partition("; ")
        said.append(f"Holds {kind}: {_few(names)}" + (f"; {advice}." if advice else "."))
    return said


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} others" if len(names) > 8 else "")


def channels_page(found: Survey, path: str | PathLike[str], *, source: str) -> None:
    """Write one HTML page with the table, a picture of each channel, and the proposal.

    Parameters
    ----------
    found : Survey
        What the file holds.
    path : path-like
        The page to write; replaced as a whole, or not at all.
    source : str
        The file as the person named it.
    """
    from markupsafe import Markup

    from hmpim.report.html import page_environment

    rows = []
    reasons = dict(found.proposal.reasons)
    for k, (d, series) in enumerate(zip(found.descriptions, found.series, strict=True)):
        role = "in" if d.name in found.proposal.inputs else ""
        role = "out" if d.name in found.proposal.outputs else role
        picture = ""
        if k < _PICTURES:
            # The only text that is not escaped: made by an XML writer, which has escaped it.
            picture = Markup(_picture(series, k, role))
        rows.append(
            {
                "name": d.name,
                "cells": [d.unit or "–", _rate(d), _span(d), str(d.samples), _gaps(d), _range(d)],
                "role": role,
                "reason": reasons.get(d.name, ""),
                "picture": picture,
            }
        )
    page = (
        page_environment()
        .get_template("channels.html.j2")
        .render(
            file=found.file,
            form=found.contents.format,
            time=_time_words(found),
            rows=rows,
            lines=[*_odd(found.descriptions), *(f.message for f in _findings(found))],
            unread=_unread(found),
            proposed=_proposed(found, source),
            shown=_PICTURES,
        )
    )
    write_text(path, "\n".join(printable(line) for line in page.splitlines()) + "\n")


def _picture(series: Series, place: int, role: str) -> str:
    colours: dict[str, Colour] = {"in": "input", "out": "output", "": "model"}
    time = series.time if series.time is not None else np.arange(series.values.size, dtype=float)
    figure = channel_picture(
        time, series.values, name=series.name, unit=series.unit, colour=colours[role]
    )
    return inline_svg(
        figure,
        key=f"channel-{place}",
        title=series.name,
        description=f"{series.name} over time, {series.values.size} samples.",
    )
