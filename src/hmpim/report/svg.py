"""Pictures for a page: one for its own width, one for a phone, colours that follow the page."""

from dataclasses import replace

from hmpim.plots.description import Figure
from hmpim.plots.draw.with_svg import draw

__all__ = ["inline_svg"]

PHONE = 350.0  # px; what a screen of 390 leaves between its margins


def inline_svg(
    figure: Figure, *, key: str, title: str, description: str, phone: bool = True
) -> str:
    """Turn a figure into ``<svg>`` elements for a page, named for screen readers.

    Every id starts with `key`, so that several figures can stand in one page, and no address
    outside is left in it. Colours are CSS variables (``--input``, ``--ink``, …), which a dark
    page can change. A second drawing, made for a phone, has the class ``narrow`` and the first
    ``wide``: the page's style shows one of them.

    Parameters
    ----------
    figure : Figure
        What to show.
    key : str
        Unique in the page; letters, digits and dashes.
    title, description : str
        Short name, and what is to be seen, in words.
    phone : bool
        Whether to draw the narrow one as well.

    Returns
    -------
    str

    Examples
    --------
    >>> from hmpim.plots.description import Axis, Panel
    >>> figure = Figure(panels=(Panel(x=Axis(), y=Axis()),), alt="")
    >>> text = inline_svg(figure, key="f1", title="Nothing", description="Empty axes.")
    >>> text.startswith('<svg aria-labelledby="f1-title f1-desc"'), "http" in text
    (True, False)
    >>> text.count('class="plot wide"'), text.count('class="plot narrow"')
    (1, 1)
    """
    told = replace(figure, alt=description or figure.alt)
    wide = draw(told, key=key, title=title, themed=True)
    if not phone:
        return wide
    narrow = draw(told, key=f"{key}-n", title=title, width=PHONE, themed=True)
    return wide.replace('class="plot"', 'class="plot wide"', 1) + narrow.replace(
        'class="plot"', 'class="plot narrow"', 1
    )
