"""One door for all record files: the content says which reader."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RecordError
from hmpim.formats.assemble import assemble, check_units, cut_runs, timed
from hmpim.formats.options import ReadOptions
from hmpim.formats.readers import Layout
from hmpim.formats.roles import assumed_roles, choose_roles
from hmpim.formats.together import open_logs
from hmpim.record import Finding, Motion, Record, find_motions
from hmpim.record.sweeps import cut_alike

__all__ = ["read", "read_sweeps"]


@checked
def read(
    path: str | PathLike[str],
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    units: Mapping[str, str] | None = None,
    references: Sequence[str] | None = None,
    auxiliary: Sequence[str] | None = None,
    options: ReadOptions | None = None,
) -> Record:
    r"""Read a record from a file of any format that a reader knows.

    The content of the file says what it is, whatever its name. Which channels go in and which
    come out is never guessed from their order.

    Parameters
    ----------
    path : str or path-like
        The file; `hmpim.formats.readers.readers` lists the formats.
    inputs, outputs : sequence of str, optional
        Names of the input and output channels. Without: those that the file states, else the one
        named u, input, command, stimulus or position, and the one named y, output, measured or
        response, in any case.
    fs : float, optional
        Rate in Hz, needed if there is no time in the file.
    time : str, optional
        Name of the time channel. Without: time or t, in any case. In seconds unless its heading
        says otherwise, as ``time [ms]``.
    units : mapping of str to str, optional
        Unit by channel name; overrides that of the file.
    references, auxiliary : sequence of str, optional
        Names of the channels that hold the command of a loop, and of those that are kept but
        never fitted. Without: those that the file states.
    options : ReadOptions, optional
        Part of the file to read, offsets of clocks, further files of the same test, and more.

    Returns
    -------
    Record

    Raises
    ------
    FormatError
        If there is no such file, no reader for it, or the file is not what it claims to be.
    RecordError
        If the data cannot be used: time that starts again with no sweep named, and the like.
    UnitError
        If a unit is not known.
    MissingExtraError
        If the format needs a package that is not installed; the message names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "test.csv")
    >>> _ = path.write_text("# bench 2\nmeasured;time [ms];command [V]\n0;0;1\n1;5;1\n2;10;1")
    >>> record = read(path)
    >>> record.fs, record.inputs[0].name, record.inputs[0].unit, record.outputs[0].name
    (200.0, 'command', 'V', 'measured')
    >>> folder.cleanup()
    """
    options = options or ReadOptions()
    wish = _Wish(
        path=Path(path),
        roles=(inputs, outputs, references, auxiliary),
        fs=fs,
        time=time,
        units=units or {},
        options=options,
    )
    runs, ours = _runs(wish)
    if options.sweep is not None:
        motions = _motions(runs)
        if not 1 <= options.sweep <= len(motions):
            raise ArgumentError(
                f"there is no sweep {options.sweep}: {Path(path).name!r} has "
                f"{_told([m for _, m in motions])}"
            )
        run, motion = motions[options.sweep - 1]
        return run.between(motion.start, motion.stop)
    if len(runs) > 1:
        motions = _motions(runs)
        raise RecordError(
            f"time starts again in {Path(path).name!r}: the file holds {len(runs)} recordings with "
            f"{_told([m for _, m in motions])}; choose one with --sweep N, or all with --sweep all"
        )
    return runs[0] if ours else _with_motions_said(runs[0])


def read_sweeps(
    path: str | PathLike[str],
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    fs: float | None = None,
    time: str | None = None,
    units: Mapping[str, str] | None = None,
    references: Sequence[str] | None = None,
    auxiliary: Sequence[str] | None = None,
    options: ReadOptions | None = None,
) -> tuple[Record, ...]:
    """Read every sweep of a file as a record of its own, in order.

    The parameters are those of `read`; motions of the first input that are no sweeps are left
    out.

    Raises
    ------
    RecordError
        If there is no sweep.
    """
    wish = _Wish(
        path=Path(path),
        roles=(inputs, outputs, references, auxiliary),
        fs=fs,
        time=time,
        units=units or {},
        options=options or ReadOptions(),
    )
    runs, _ = _runs(wish)
    sweeps = []
    for run in runs:
        found = [m for m in find_motions(run.inputs[0]) if m.kind == "sweep"]
        sweeps += [run.between(*span) for span in cut_alike(run.inputs[0], found)]
    if not sweeps:
        raise RecordError(
            f"no sweep is found in {runs[0].inputs[0].name!r} of {wish.path.name!r}: it has "
            f"{_told([m for _, m in _motions(runs)])}; cut one out with --from and --to"
        )
    return tuple(sweeps)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wish:
    """What is asked of a file; `roles` are inputs, outputs, references and auxiliary channels."""

    path: Path
    roles: tuple[Sequence[str] | None, ...]
    fs: float | None
    time: str | None
    units: Mapping[str, str]
    options: ReadOptions


def _runs(wish: _Wish) -> tuple[list[Record], bool]:
    """Records of a file, one for each time that its clock starts again, cut to the span.

    Also says whether the file states the roles itself, as our own do.
    """
    file, fs, options = wish.path, wish.fs, wish.options
    logs = open_logs(
        file,
        layout=Layout(time=wish.time, fs=fs, stamps=options.stamps, sheet=options.sheet),
        beside=[Path(other) for other in options.beside],
        common=options.common,
    )
    check_units(wish.units, logs.contents, file.name)
    inputs, outputs, references, auxiliary = wish.roles
    roles = choose_roles(
        logs.contents,
        file.name,
        inputs=inputs,
        outputs=outputs,
        references=references,
        auxiliary=auxiliary,
    )
    series, said = logs.read(roles.names, options.offsets)
    assumed = assumed_roles(roles, logs.contents, inputs=inputs, outputs=outputs)
    runs = [
        assemble(part, roles, logs.contents, file=file.name, fs=fs, units=wish.units, findings=said)
        for part in cut_runs(timed(series, fs=fs))
    ]
    runs = [replace(run, findings=(*run.findings, *assumed)) for run in runs]
    return _in_span(runs, options, file.name), bool(logs.contents.inputs)


def _in_span(runs: Sequence[Record], options: ReadOptions, file: str) -> list[Record]:
    low = -np.inf if options.start is None else options.start
    high = np.inf if options.stop is None else options.stop
    if not low < high:
        raise ArgumentError(
            f"the part from {low:g} s to {high:g} s is empty; it must end after it starts"
        )
    if low == -np.inf and high == np.inf:
        return list(runs)
    kept = [run.between(low, high) for run in runs if _holds(run, low, high)]
    if kept:
        return kept
    spans = [(float(r.outputs[0].time[0]), float(r.outputs[0].time[-1])) for r in runs]
    listed = ", ".join(f"{a:.6g} s to {b:.6g} s" for a, b in spans[:3])
    raise ArgumentError(f"nothing of {file!r} lies in that part; it goes from {listed}")


def _holds(run: Record, low: float, high: float) -> bool:
    return all(
        np.count_nonzero((c.time >= low) & (c.time < high)) >= 2
        for c in (*run.inputs, *run.outputs)
    )


def _motions(runs: Sequence[Record]) -> list[tuple[Record, Motion]]:
    return [(run, motion) for run in runs for motion in find_motions(run.inputs[0])]


def _told(motions: Sequence[Motion]) -> str:
    """The motions as a numbered list in words."""
    if not motions:
        return "no motion of the input"
    words = [f"{k}: {m}" for k, m in enumerate(motions[:12], start=1)]
    more = f"; and {len(motions) - 12} more" if len(motions) > 12 else ""
    return (
        f"{len(motions)} {'motion' if len(motions) == 1 else 'motions'} ({'; '.join(words)}{more})"
    )


def _with_motions_said(record: Record) -> Record:
    """A record of several sweeps, with a word on it."""
    motions = find_motions(record.inputs[0])
    if sum(m.kind == "sweep" for m in motions) < 2:
        return record
    finding = Finding(
        code="several_sweeps",
        message=(
            f"{record.inputs[0].name!r} makes {_told(motions)}, and all of it is used as one "
            "record; take one with --sweep N, or each as a repeat with --sweep all"
        ),
        severity="info",
        parameters=(),
    )
    return replace(record, findings=(*record.findings, finding))
