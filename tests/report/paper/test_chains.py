"""Figs 1 and 6, which are drawings: words in boxes, arrows between them."""

import pytest

from hmpim.plots.description import Band, Words
from hmpim.plots.draw.frames import frames
from hmpim.plots.draw.layout import text_width
from hmpim.report.paper.chains import chains_chapter
from hmpim.report.svg import PHONE


@pytest.mark.parametrize("number", [1, 6])
def test_words_fit_their_boxes_on_a_phone(number):
    figure = chains_chapter().pictures[number].figure
    (panel,), (frame,) = figure.panels, frames(figure)
    per_unit = PHONE / (frame.x[1] - frame.x[0])
    boxes = [item for item in panel.of(Band) if item.opacity < 1.0]  # arrows are solid
    assert len(boxes) == 7
    inside = 0
    for words in panel.of(Words):
        for box in boxes:
            if box.x[0] < words.x < box.x[1] and box.low[0] < words.y < box.high[0]:
                inside += 1
                assert text_width(words.text) <= per_unit * (box.x[1] - box.x[0])
    assert inside >= 10
