"""A study in a folder: pictures, the table three ways, and one page with all of it."""

import json
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from hmpim.formats.atomic import replacing, write_text
from hmpim.plots.description import Figure
from hmpim.report.paper.chains import ALIASING
from hmpim.report.paper.rows import COLUMNS, cells, markdown_table, table_dict
from hmpim.report.paper.study import Study
from hmpim.report.svg import inline_svg

__all__ = ["render_page", "write_study"]

DPI = 150


def write_study(
    study: Study,
    folder: str | PathLike[str],
    *,
    tick: Callable[[str], None] | None = None,
) -> None:
    """Write ``figNN.png``, ``figNN.svg``, ``table.md``, ``table.json`` and ``index.html``.

    Each file is replaced as a whole or not at all; other files in the folder stay.

    Parameters
    ----------
    study : Study
        What was made.
    folder : path-like
        Where to; made if it is missing.
    tick : callable, optional
        Told of each figure written and of each other file, by its name.

    Raises
    ------
    OSError
        If the folder cannot be made or written to.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_study(Study(pictures={}, rows=()), folder)
    ...     sorted(path.name for path in Path(folder).iterdir())
    ['index.html', 'table.json', 'table.md']
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    for picture in study.pictures.values():
        _save(picture.figure, place / f"{picture.key}.png", "png")
        _save(picture.figure, place / f"{picture.key}.svg", "svg")
        if tick is not None:
            tick(f"{picture.key}.png")
    data = {
        **table_dict(study.rows),
        "figures": [
            {
                "figure": number,
                "title": picture.title,
                "caption": picture.caption,
                "files": [f"{picture.key}.png", f"{picture.key}.svg"],
            }
            for number, picture in study.pictures.items()
        ],
    }
    for name, text in (
        ("table.md", markdown_table(study.rows)),
        ("table.json", json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"),
        ("index.html", render_page(study)),
    ):
        write_text(place / name, text)
        if tick is not None:
            tick(name)


def render_page(study: Study) -> str:
    """Return one HTML page with every figure and the table; it needs no other file.

    Examples
    --------
    >>> render_page(Study(pictures={}, rows=()))[:15]
    '<!DOCTYPE html>'
    """
    from markupsafe import Markup

    from hmpim.report.html import page_environment

    figures: list[dict[str, Any]] = [
        {
            "name": picture.title if number == ALIASING else f"Fig. {number}",
            "key": picture.key,
            "title": picture.title,
            "caption": picture.caption,
            # made by an XML writer, which has escaped it
            "svg": Markup(
                inline_svg(
                    picture.figure,
                    key=picture.key,
                    title=picture.title,
                    description=picture.description,
                )
            ),
        }
        for number, picture in study.pictures.items()
    ]
    rows = [
        {"cells": cells(row), "figure": row.figure if row.figure in study.pictures else None}
        for row in study.rows
    ]
    template = page_environment("hmpim.report.paper").get_template("paper.html.j2")
    return template.render(figures=figures, rows=rows, columns=COLUMNS)


def _save(figure: Figure, path: Path, kind: str) -> None:
    """Save a figure so that the same study gives the same bytes."""
    with replacing(path) as place:
        figure.savefig(place, dpi=DPI, format=kind)
