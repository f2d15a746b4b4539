"""Figures as inline SVG: no address outside, ids of their own, colours that follow the page."""

import io
import re
import warnings
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

from hmpim.plots.description import Figure as Description
from hmpim.plots.style import COLOURS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["inline_svg"]

_DECIMALS = re.compile(r"(\.\d\d)\d+")
_REFERENCE = re.compile(r"url\(#")


def inline_svg(figure: "Figure | Description", *, key: str, title: str, description: str) -> str:
    """Turn a figure into an ``<svg>`` element for a page, named for screen readers.

    Every id starts with `key`, so that several figures can stand in one page. Namespaces and
    metadata are dropped: HTML needs neither, and so no address is left in the page. Colours of
    the style become CSS variables (``--input``, ``--ink``, …), which a dark page can change.

    Parameters
    ----------
    figure : Figure
        What to show.
    key : str
        Unique in the page; letters, digits and dashes.
    title, description : str
        Short name, and what is to be seen, in words.

    Returns
    -------
    str

    Examples
    --------
    >>> from hmpim.plots.style import new_figure
    >>> figure, _ = new_figure()
    >>> text = inline_svg(figure, key="f1", title="Nothing", description="Empty axes.")
    >>> text.startswith('<svg aria-labelledby="f1-title f1-desc"'), "http" in text
    (True, False)
    """
    drawn = figure.to_matplotlib() if isinstance(figure, Description) else figure
    root = ET.fromstring(_rendered(drawn, key))
    for parent in root.iter():
        for child in list(parent):
            if _local(child.tag) == "metadata":
                parent.remove(child)
    variables = {colour: f"var(--{name})" for name, colour in COLOURS.items()}
    for element in root.iter():
        element.tag = _local(element.tag)
        element.attrib = {
            _local(name): _rewritten(_local(name), value, key, variables)
            for name, value in element.attrib.items()
        }
        if element.tag == "style" and element.text:
            # A style element is global in a page; its one rule goes to the page's own sheet.
            element.text = None
    kept = {"viewBox": root.attrib["viewBox"], "class": "plot", "role": "img"}
    root.attrib = {"aria-labelledby": f"{key}-title {key}-desc", **kept}
    for place, (tag, text) in enumerate((("title", title), ("desc", description))):
        named = ET.Element(tag, {"id": f"{key}-{tag}"})
        named.text = text
        root.insert(place, named)
    return ET.tostring(root, encoding="unicode")


def _rendered(figure: "Figure", key: str) -> bytes:
    import matplotlib as mpl

    buffer = io.BytesIO()
    # Text stays text: smaller, searchable, and in the reader's own font.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": key}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    return buffer.getvalue()


def _local(name: str) -> str:
    return name.rpartition("}")[2]


def _rewritten(name: str, value: str, key: str, variables: dict[str, str]) -> str:
    if name == "id":
        return f"{key}-{value}"
    if name == "href":
        return value.replace("#", f"#{key}-", 1)
    if name in ("d", "points"):
        return _DECIMALS.sub(r"\1", value)
    value = _REFERENCE.sub(f"url(#{key}-", value)
    if name in ("style", "fill", "stroke"):
        for colour, variable in variables.items():
            value = value.replace(colour, variable)
    return value
