"""What our own CSV notes in a comment, since a table cannot hold it."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import get_args

from hmpim.errors import FormatError
from hmpim.formats.readers.text.headings import Heading
from hmpim.record import Finding, Intersample, Role, Stopping

__all__ = ["KINDS", "MARK", "Notes", "heading_of", "read_notes"]

MARK = "hmpim/record/1 "
"""What the comment starts with in which `write_csv` notes what a table cannot hold."""

KINDS: dict[str, Role] = {
    "inputs": "input",
    "outputs": "output",
    "references": "reference",
    "auxiliary": "auxiliary",
}
"""Names in that comment, and the role of the channels that they list."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Notes:
    """What `write_csv` noted.

    Parameters
    ----------
    headings : tuple of Heading
        The columns, time first, with the names and units that were noted.
    names : dict of str to tuple of str
        Names of the channels by kind, as in `KINDS`.
    fs : float
        Nominal rate in Hz.
    band : tuple of float or None
        Excited band in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the inputs do between samples.
    source : str
        Where the record comes from.
    findings : tuple of Finding
        What was noticed when the record was first read.
    stopping : Stopping or None
        That the run was ended because it was sure.
    """

    headings: tuple[Heading, ...]
    names: dict[str, tuple[str, ...]]
    fs: float
    band: tuple[float, float] | None
    intersample: Intersample | None
    source: str
    findings: tuple[Finding, ...]
    stopping: Stopping | None


def heading_of(name: str, unit: str) -> str:
    """Return the heading of a column that `write_csv` writes.

    Examples
    --------
    >>> heading_of("u", "deg"), heading_of("a,b", "")
    ('u [deg]', '"a,b"')
    """
    name = re.sub(r"[\x00-\x1f\x7f\x85\u2028\u2029\"]+", " ", name).strip() or "channel"
    heading = f"{name} [{unit}]" if unit else name
    return f'"{heading}"' if re.search(r"[,;#]", heading) else heading


def read_notes(comments: Sequence[str], headings: Sequence[Heading], *, file: str) -> Notes | None:
    """Return what `write_csv` noted, if the columns are still those it wrote.

    Raises
    ------
    FormatError
        If the comment is there and spoilt.
    """
    for comment in comments:
        if comment.startswith(MARK):
            try:
                noted = json.loads(comment.removeprefix(MARK))
                return _checked(noted, headings)
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
                raise FormatError(
                    f"{file!r} starts with a damaged comment {comment[:40]!r} ({error}); "
                    "delete that line"
                ) from None
    return None


def _checked(noted: object, headings: Sequence[Heading]) -> Notes | None:
    if not isinstance(noted, dict):
        raise ValueError("it is no JSON object")
    pairs = {
        kind: [(str(c["name"]), str(c["unit"])) for c in noted.get(kind, [])] for kind in KINDS
    }
    if noted["intersample"] not in (None, *get_args(Intersample)):
        raise ValueError(f"intersample {noted['intersample']!r}")
    band = None
    if noted["band"] is not None:
        low, high = noted["band"]
        band = (float(low), float(high))
    both = [pair for kind in KINDS for pair in pairs[kind]]
    written = ["time [s]", *(heading_of(name, unit).strip('"') for name, unit in both)]
    if [h.text for h in headings] != written:
        return None
    return Notes(
        headings=tuple(
            replace(h, name=name, unit=unit)
            for h, (name, unit) in zip(headings, [("time", "s"), *both], strict=True)
        ),
        names={kind: tuple(name for name, _ in pairs[kind]) for kind in KINDS},
        fs=float(noted["fs"]),
        band=band,
        intersample=noted["intersample"],
        source=str(noted["source"]),
        findings=tuple(Finding.from_dict(f) for f in noted.get("findings", [])),
        stopping=Stopping.from_dict(noted["stopping"]) if noted.get("stopping") else None,
    )
