"""What a reader is: three functions and the facts that a person needs about its format."""

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Literal

from hmpim.arguments import check_rate, check_size
from hmpim.errors import ArgumentError, MissingExtraError
from hmpim.record import Finding, Intersample, Series, Stopping

__all__ = [
    "COMPLEX",
    "WORDS",
    "ChannelInfo",
    "Contents",
    "Layout",
    "Reader",
    "Stamps",
    "check_used",
    "listed",
    "need",
]

WORDS = "words, no numbers"
"""What a column of text holds, for messages."""

COMPLEX = "complex numbers; save the real part, or the magnitude"
"""The same of a channel that has two numbers for each sample, with what to do about it."""

Stamps = Literal["auto", "header", "log"]
"""Which stamp counts where a file holds two: the sender's own, or the logger's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What a person says about a file that the file does not say itself.

    Parameters
    ----------
    time : str or None
        Name of the time column or channel.
    fs : float or None
        Rate in Hz of channels without time.
    stamps : {'auto', 'header', 'log'}
        Which stamp counts where each message has two: the sender's ('header') or the logger's
        ('log'). 'auto' takes the sender's where there is one.
    sheet : str or None
        Sheet of a workbook, or table of a file with several; the first if None.

    Raises
    ------
    ArgumentError
        If the rate is none.

    Examples
    --------
    >>> Layout(time="stamp").stamps
    'auto'
    """

    time: str | None = None
    fs: float | None = None
    stamps: Stamps = "auto"
    sheet: str | None = None

    def __post_init__(self) -> None:
        if self.fs is not None:
            check_rate(self.fs)
            check_size("fs", self.fs, "Hz")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelInfo:
    """What a file says of a channel without its samples being read.

    Parameters
    ----------
    name : str
        Name by which the channel is asked for; unique in its file.
    unit : str
        Unit as the file states it; empty where it states none.
    samples : int or None
        Number of samples; None where that is known only by reading them.
    clock : str
        Name of the channel, message or group whose stamps it has; channels of one clock have
        equal names. Empty where the file has one clock, or none.
    holds : str
        What it holds in place of real numbers, such as `WORDS`; it then cannot be read as a
        signal. Empty where it can.
    """

    name: str
    unit: str = ""
    samples: int | None = None
    clock: str = ""
    holds: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """What is in a file, and what the file itself says of the test.

    Parameters
    ----------
    format : str
        Name of the format, for people: 'text', 'MAT 5'.
    channels : tuple of ChannelInfo
        All channels but the time itself.
    time : str or None
        Name of the channel that time was taken from, where there is one for all.
    origin : float or None
        Unix time in s at which the file's time is 0; None where it does not tell.
    inputs, outputs, references, auxiliary : tuple of str
        Names of the channels whose role the file states.
    fs : float or None
        Nominal rate in Hz, where the file states it.
    band : tuple of float or None
        Excited band in Hz, where the file states it.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the inputs do between samples, where the file states it.
    source : str or None
        Where the data come from, where the file states it.
    findings : tuple of Finding
        What a person should know about the file as a whole.
    """

    format: str
    channels: tuple[ChannelInfo, ...]
    time: str | None = None
    origin: float | None = None
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    references: tuple[str, ...] = ()
    auxiliary: tuple[str, ...] = ()
    fs: float | None = None
    band: tuple[float, float] | None = None
    intersample: Intersample | None = None
    source: str | None = None
    findings: tuple[Finding, ...] = ()
    stopping: Stopping | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """One format: how it is recognised, listed and read.

    The functions must be at the top level of a module, so that a worker process can run
    them.

    Parameters
    ----------
    format : str
        Name of the format, for people.
    sniff : function of (head, path) to bool
        Whether a file is of this format. `head` is its first `HEAD` bytes (fewer if the file is
        shorter); the path is for what only the name or the inside can tell. It must be quick,
        raise nothing, and import no optional package.
    channels : function of (path, layout) to Contents
        List the channels. Values are read only where there is no other way.
    read : function of (path, names, layout) to a tuple of Series
        Read the named channels, in that order, each on its own clock, NaN where a sample is
        missing. Nothing is mended, resampled or converted but time, which is in s.
    extra : str
        Extra of hmpim that installs what the reader needs; empty if nothing.
    foreign : bool
        True if code of others parses the bytes, so that it must run in a worker process.
    uses : tuple of {'sheet', 'stamps'}
        Parts of the layout that the format has a use for; the others are refused.

    Both `channels` and `read` raise `hmpim.errors.FormatError` for a file that is damaged, and
    `MissingExtraError` (by `need`) where a package is missing.
    """

    format: str
    sniff: Callable[[bytes, Path], bool]
    channels: Callable[[Path, Layout], Contents]
    read: Callable[[Path, Sequence[str], Layout], tuple[Series, ...]]
    extra: str = ""
    foreign: bool = False
    uses: tuple[Literal["sheet", "stamps"], ...] = ("sheet", "stamps")


def check_used(layout: Layout, file: str, reader: Reader, *, beside: Sequence[Reader] = ()) -> None:
    """Refuse what a person says about a file whose format has no use for it.

    Parameters
    ----------
    layout : Layout
        What is said.
    file : str
        Name of the file.
    reader : Reader
        Its reader.
    beside : sequence of Reader
        Those of other files of the test, of which stamps are chosen as well.

    Raises
    ------
    ArgumentError
        If a sheet is named, or stamps are chosen, where there is no choice.
    """
    if layout.sheet is not None and "sheet" not in reader.uses:
        raise ArgumentError(
            f"sheet = {layout.sheet!r} is given, and {file!r} ({reader.format}) has no sheets; "
            "leave it out"
        )
    if layout.stamps != "auto" and not any("stamps" in each.uses for each in (reader, *beside)):
        raise ArgumentError(
            f"stamps = {layout.stamps!r} is given, and {file!r} ({reader.format}) has one stamp a "
            "message; leave it out"
        )


_LISTED = 20


_LONGEST = 60
"""Characters of a name that a message shows."""


def listed(names: Sequence[str]) -> str:
    """Return names for a message, the first twenty of them.

    Examples
    --------
    >>> listed(["u", "y"]), listed([])
    ('u, y', 'none except time')
    >>> listed([str(k) for k in range(100)])[-24:]
    '17, 18, 19 and 80 others'
    """
    more = f" and {len(names) - _LISTED} others" if len(names) > _LISTED else ""
    short = [n if len(n) <= _LONGEST else n[:_LONGEST] + "…" for n in names[:_LISTED]]
    return ", ".join(short) + more or "none except time"


def need(module: str, *, extra: str, what: str) -> ModuleType:
    """Import an optional package, or say what to install.

    Parameters
    ----------
    module : str
        Name to import, such as 'openpyxl'.
    extra : str
        Extra of hmpim that installs it.
    what : str
        What it is needed for, such as 'an Excel file'.

    Raises
    ------
    MissingExtraError
        If it is not installed, or cannot be imported.

    Examples
    --------
    >>> need("math", extra="none", what="this example").sqrt(4)
    2.0
    >>> need("no_such_package", extra="excel", what="an Excel file")
    Traceback (most recent call last):
    ...
    hmpim.errors.MissingExtraError: an Excel file needs the package 'no_such_package', which is \
not installed; run: pip install 'hmpim[excel]'
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is not None and error.name.partition(".")[0] != module.partition(".")[0]:
            raise MissingExtraError(
                f"{what} needs the package {module!r}, which needs {error.name!r}, which is not "
                f"installed; run: pip install 'hmpim[{extra}]'"
            ) from None
        raise MissingExtraError(
            f"{what} needs the package {module!r}, which is not installed; "
            f"run: pip install 'hmpim[{extra}]'"
        ) from None
    except Exception as error:  # a package of others that breaks while it is imported
        raise MissingExtraError(
            f"{what} needs the package {module!r}, which cannot be imported "
            f"({type(error).__name__}: {error}); install it again: pip install 'hmpim[{extra}]'"
        ) from None
