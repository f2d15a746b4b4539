"""`hmpim compress`: records in, a small file of statistics out; and such files read again."""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.reading import (
    From,
    Rate,
    Sheet,
    StampChoice,
    Stamps,
    Sweep,
    Time,
    To,
    Unit,
    read_records,
    reading,
    refuse_options,
    units_of,
)
from hmpim.cli.terminal import say, working
from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from hmpim.identify import Statistics
    from hmpim.record import Record

__all__ = ["compress", "refuse_twice", "runs_of", "statistics_of"]


class Bias(StrEnum):
    """Whether runs that are joined have one bias."""

    OWN = "own"
    COMMON = "common"


def compress(
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORD",
            help="Records of one unit, or files that this command wrote. Several are joined, each "
            "as a run of its own.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="File to write, .h5 or .hdf5.")
    ],
    input_: Annotated[
        str | None, typer.Option("--input", metavar="NAME", help="Channel of the input.")
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", metavar="NAME", help="Channel of the output.")
    ] = None,
    fs: Rate = None,
    time: Time = None,
    unit: Unit = None,
    from_: From = None,
    to: To = None,
    sweep: Sweep = None,
    stamps: StampChoice = Stamps.AUTO,
    sheet: Sheet = None,
    lags: Annotated[
        int | None,
        typer.Option(
            "--lags",
            metavar="N",
            help="Window in samples, into which delay and settling time must fit; by default a "
            "fifth of the first record, at most 16384.",
        ),
    ] = None,
    bias: Annotated[
        Bias,
        typer.Option("--bias", help="Whether each run has a bias of its own, or all have one."),
    ] = Bias.OWN,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing.")] = False,
) -> None:
    """Compress records to the statistics that identification needs, some tens of kilobytes.

    `hmpim identify` accepts the file in place of a record, but skips checks that need the samples.
    """
    _check_file(out)
    check_files(reads={"the record": records}, writes={"-o": out})

    from hmpim.formats import save

    about_samples = {
        **{"--input": input_, "--output": output, "--fs": fs, "--time": time, "--unit": unit},
        **{"--from": from_, "--to": to, "--sweep": sweep, "--sheet": sheet, "--lags": lags},
    }
    _refuse_unused(records, about_samples)
    roles = {"inputs": input_ and [input_], "outputs": output and [output]}
    options = reading(start=from_, stop=to, sweep=sweep, stamps=stamps, sheet=sheet)
    joined: Statistics | None = None
    for path in records:
        runs = statistics_of([path], {})
        if runs is not None and lags not in (None, runs.lags):
            raise ArgumentError(
                f"--lags {lags}: {path} has a window of {runs.lags} samples, and all runs have "
                "one; leave it out, or give the record"
            )
        if runs is None:
            given = read_records(
                [path],
                roles=roles,
                fs=fs,
                time=time,
                units=units_of(unit),
                options=options,
                every=sweep == "all",
            )
            window = lags if joined is None else joined.lags
            names = [repr(str(path))] * len(given)
            runs = runs_of(given, names, (input_, output), lags=window, bias=bias)
        joined = runs if joined is None else _join(joined, runs, (records[0], path), bias)
    if joined is None:  # Typer asks for one record at least
        return
    refuse_twice(joined)
    save(joined, out)
    if not quiet:
        say(_sentence(joined, out))


def _refuse_unused(records: Sequence[Path], about_samples: Mapping[str, object]) -> None:
    """Refuse options about samples where only statistics are given."""
    from hmpim.formats.statistics_files import holds_statistics

    if all(holds_statistics(path) for path in records):
        _refuse_without_samples(records[0], about_samples)


def _refuse_without_samples(compressed: Path, about_samples: Mapping[str, object]) -> None:
    """Refuse options that only a record has a use for."""
    refuse_options(
        about_samples,
        f"is about the samples of a record, and {compressed} holds statistics of them; leave it "
        "out, or give the record",
    )


def refuse_twice(joined: "Statistics", names: Sequence[str] | None = None) -> None:
    """Refuse a run that counts twice, which would make error bars too small.

    `names` are what messages call each run, numbers from 1 where there are none.
    """
    seen: dict[bytes, int] = {}
    for place, run in enumerate(joined.runs, start=1):
        first = seen.setdefault(run.vu.tobytes() + run.level.tobytes(), place)
        if first != place:
            called = names or [f"run {k}" for k in range(1, place + 1)]
            raise ArgumentError(
                f"{called[first - 1]} and {called[place - 1]} hold the same samples; "
                "one record given twice is not two runs, so leave one out"
            )


def statistics_of(
    paths: Sequence[Path], reading_options: Mapping[str, object]
) -> "Statistics | None":
    """Read files of statistics and join their runs; None where the first file is none.

    Parameters
    ----------
    paths : sequence of Path
        Files, all of statistics or none.
    reading_options : mapping of str to object
        What was given of the options that are about samples, by option; None where it was not.

    Raises
    ------
    ArgumentError
        If files of both kinds are given, or an option that only a record has a use for.
    FormatError
        If a file is damaged.
    """
    from hmpim.formats.statistics_files import holds_statistics, read_statistics

    compressed = [path for path in paths if holds_statistics(path)]
    if not compressed:
        return None
    if others := [path for path in paths if path not in compressed]:
        raise ArgumentError(
            f"{compressed[0]} holds statistics and {others[0]} does not; compress both with hmpim "
            "compress, or give the records themselves"
        )
    _refuse_without_samples(compressed[0], reading_options)
    joined = read_statistics(compressed[0])
    for path in compressed[1:]:
        joined = _join(joined, read_statistics(path), (compressed[0], path))
    refuse_twice(joined)
    return joined


def _join(
    first: "Statistics", other: "Statistics", files: tuple[Path, Path], bias: Bias | None = None
) -> "Statistics":
    """Join runs of two files, which are named where they are not of one kind."""
    try:
        return first.join(other, bias=None if bias is None else bias.value)
    except ArgumentError as error:
        here, there = files
        raise ArgumentError(
            f"{here} (here) and {there} (there) cannot be combined: {error}"
        ) from None


def runs_of(
    given: "Sequence[Record]",
    names: Sequence[str],
    named: tuple[str | None, str | None],
    *,
    lags: int | None = None,
    bias: Bias = Bias.OWN,
) -> "Statistics":
    """Compress each record to a run, with the window of the first; the runs joined.

    `names` are what messages call each record. `named` are the channels of input and output; None
    for the only one that there is.
    """
    from hmpim.identify import compress as compressed
    from hmpim.identify.records.alike import naming

    runs: list[Statistics] = []
    with working("Compressing"):
        for name, record in zip(names, given, strict=True):
            source, answer = named
            window = runs[0].lags if runs else lags
            with naming(name, arguments=True):
                channels = (
                    source or _only(record.inputs, "--input"),
                    answer or _only(record.outputs, "--output"),
                )
                runs.append(compressed(record, lags=window, channels=channels, bias=bias.value))
    return runs[0].join(*runs[1:])


def _only(channels: Sequence[object], option: str) -> str:
    """Name of the only channel of a role."""
    names = [str(getattr(channel, "name", "")) for channel in channels]
    if len(names) != 1:
        raise ArgumentError(
            f"the record has {len(names)} channels for {option} ({', '.join(names)}); statistics "
            f"are of one input and one output, so name it with {option}"
        )
    return names[0]


def _check_file(out: Path) -> None:
    """Refuse a name of which nothing could be written, before any work."""
    from hmpim.formats.saving import suffixes_of
    from hmpim.identify import Statistics

    if out.suffix.lower() not in suffixes_of(Statistics):
        raise ArgumentError(f"-o {out} must end in one of {', '.join(suffixes_of(Statistics))}")


def _sentence(statistics: "Statistics", out: Path) -> str:
    count = len(statistics.runs)
    source, answer = statistics.names
    return (
        f"{out}: {statistics.samples} samples of {source} → {answer} at {statistics.fs:g} Hz in "
        f"{count} run{'s' if count > 1 else ''}, as statistics of {_size(statistics.nbytes)} "
        f"with a window of {statistics.lags / statistics.fs:.3g} s"
    )


def _size(count: int) -> str:
    """Return a number of bytes in words.

    Examples
    --------
    >>> _size(53_000), _size(9_606_000)
    ('53 kB', '9.61 MB')
    """
    return f"{count / 1e6:.3g} MB" if count >= 1e6 else f"{count / 1e3:.3g} kB"
