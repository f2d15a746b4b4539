"""Everything that a file holds, looked at before anything is chosen."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from hmpim.errors import FormatError
from hmpim.formats.readers import Contents, Layout, check_used, reader_for
from hmpim.record import (
    Channel,
    Description,
    Motion,
    Proposal,
    Series,
    describe,
    find_motions,
    propose,
)

__all__ = ["Survey", "survey"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """What a file holds.

    Parameters
    ----------
    file : str
        Its name.
    contents : Contents
        What it states.
    descriptions : tuple of Description
        One for each channel that holds numbers, in the file's order.
    series : tuple of Series
        Their samples as they were read.
    unread : tuple of (str, str)
        Channels that are no signals, and what each holds instead: words, complex numbers.
    proposal : Proposal
        What may be the input and the outputs, and why.
    motions : tuple of Motion
        What the proposed input does.
    """

    file: str
    contents: Contents
    descriptions: tuple[Description, ...]
    series: tuple[Series, ...]
    unread: tuple[tuple[str, str], ...]
    proposal: Proposal
    motions: tuple[Motion, ...]


def survey(path: str | PathLike[str], *, layout: Layout | None = None) -> Survey:
    r"""Read every channel of a file and describe it.

    Parameters
    ----------
    path : path-like
        The file.
    layout : Layout, optional
        What a person says about it.

    Raises
    ------
    FormatError
        If it cannot be read, or holds no numbers.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "a.csv"
    ...     rows = "".join(f"{k},{k % 7},x\n" for k in range(50))
    ...     _ = file.write_text("t [ms],u [V],note\n" + rows)
    ...     found = survey(file)
    >>> found.descriptions[0].name, found.descriptions[0].rate, found.unread
    ('u', 1000.0, (('note', 'words, no numbers'),))
    """
    file, layout = Path(path), layout or Layout()
    reader = reader_for(file)
    check_used(layout, file.name, reader)
    contents = reader.channels(file, layout)
    names = [c.name for c in contents.channels if not c.holds]
    unread = tuple((c.name, c.holds) for c in contents.channels if c.holds)
    if not names:
        why = f": {unread[0][0]!r} holds {unread[0][1]}" if unread else ""
        raise FormatError(f"{file.name!r} holds no channel of numbers{why}")
    series = reader.read(file, names, layout)
    described = [describe(s, fs=layout.fs or contents.fs) for s in series]
    usable = [channel for _, channel in described if channel is not None]
    proposal = _proposal(contents, usable)
    driver = next((c for c in usable if c.name in proposal.inputs[:1]), None)
    return Survey(
        file=file.name,
        contents=contents,
        descriptions=tuple(d for d, _ in described),
        series=series,
        unread=unread,
        proposal=proposal,
        motions=() if driver is None else find_motions(driver),
    )


def _proposal(contents: Contents, usable: list[Channel]) -> Proposal:
    if contents.inputs and contents.outputs:
        roles = {
            **dict.fromkeys(contents.inputs, "the file says that it is an input"),
            **dict.fromkeys(contents.outputs, "the file says that it is an output"),
            **dict.fromkeys(contents.references, "the file says that it is a reference"),
            **dict.fromkeys(contents.auxiliary, "the file says that it is auxiliary"),
        }
        reasons = tuple((c.name, roles.get(c.name, "the file gives it no role")) for c in usable)
        return Proposal(inputs=contents.inputs, outputs=contents.outputs, reasons=reasons)
    return propose(usable)
