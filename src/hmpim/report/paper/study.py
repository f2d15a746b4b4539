"""All that is made again of the paper, chapter by chapter."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from hmpim.errors import ArgumentError
from hmpim.report.figures import Picture
from hmpim.report.paper.chains import ALIASING, chains_chapter
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.fence import fence_chapter
from hmpim.report.paper.levels import levels_chapter
from hmpim.report.paper.rows import Row
from hmpim.report.paper.sample import sample_chapter
from hmpim.report.paper.seeker import seeker_chapter
from hmpim.report.paper.sensor import sensor_chapter
from hmpim.report.paper.waveforms import waveforms_chapter

__all__ = ["CHAPTERS", "FIGURES", "Chapter", "Study", "check_figures", "make_study"]

CHAPTERS: Mapping[Callable[[], Chapter], tuple[int, ...]] = {
    chains_chapter: (1, 6, ALIASING),
    sensor_chapter: (2, 7, 8, 9, 10, 11),
    waveforms_chapter: (3, 5),
    levels_chapter: (12, 13, 14),
    seeker_chapter: (15,),
    sample_chapter: (16, 17),
    fence_chapter: (23,),
}
FIGURES = tuple(sorted(number for numbers in CHAPTERS.values() for number in numbers))
"""Numbers of the figures that need no motion table, and `ALIASING`, which the paper lacks."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Study:
    """Figures by their number, rising, and the rows of the table in the paper's order."""

    pictures: Mapping[int, Picture]
    rows: tuple[Row, ...]


def check_figures(figures: Collection[int] | None) -> frozenset[int]:
    """Return the figures wanted; all for None.

    Raises
    ------
    ArgumentError
        If a number is not among `FIGURES`.

    Examples
    --------
    >>> sorted(check_figures([13, 12]))
    [12, 13]
    """
    wanted = frozenset(FIGURES if figures is None else figures)
    for number in sorted(wanted - set(FIGURES)):
        raise ArgumentError(
            f"figure {number} is not made here; choose one of {', '.join(map(str, FIGURES))}"
        )
    return wanted


def make_study(
    figures: Collection[int] | None = None, *, tick: Callable[[str], None] | None = None
) -> Study:
    """Run all that the figures need, and compare with what the paper prints.

    The same each time: what is random has a seed of its own.

    Parameters
    ----------
    figures : collection of int, optional
        Numbers of the figures wanted; all of `FIGURES` by default. The table has the rows
        that belong to them.
    tick : callable, optional
        Told of each figure made, such as "Fig. 12".

    Returns
    -------
    Study

    Raises
    ------
    ArgumentError
        If a figure is not among those made here.

    Examples
    --------
    >>> study = make_study([8])
    >>> list(study.pictures)
    [8]
    """
    wanted = check_figures(figures)
    pictures: dict[int, Picture] = {}
    rows: list[Row] = []
    for make, numbers in CHAPTERS.items():
        chosen = [number for number in numbers if number in wanted]
        if not chosen:
            continue
        chapter = make()
        pictures |= {number: chapter.pictures[number] for number in chosen}
        rows += [row for row in chapter.rows if row.figure in wanted]
        if tick is not None:
            for number in chosen:
                tick(f"Fig. {number}")
    rows.sort(key=lambda row: row.figure)
    return Study(pictures={n: pictures[n] for n in sorted(pictures)}, rows=tuple(rows))
