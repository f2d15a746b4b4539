"""A size in words is the same in a finding and in an export."""

import re

import pytest
from nonlinear_predictions import chirp, moved, recorded

import hmpim
from hmpim.formats.models import export
from hmpim.identify.result.sizes import size_in_words
from hmpim.model.nonlinear import NonlinearPart


@pytest.mark.parametrize("kind", ["backlash", "dead_zone", "friction", "hardening"])
def test_an_export_states_the_size_that_the_finding_states(kind, tmp_path):
    result = hmpim.identify(recorded(chirp(), moved(kind, chirp()), 1))
    pair = result["y", "u"]
    assert pair.nonlinear_part is not None
    said = size_in_words(pair.nonlinear_part, ("", ""))
    (finding,) = [w for w in pair.warnings if w.code == kind]
    assert f": {said}" in finding.message
    (file,) = export(result, to="python", path=tmp_path / "m.py")
    text = re.sub(r"[\s#]+", " ", file.read_text(encoding="utf-8"))
    assert said.replace("±", "+-") in text


def test_a_speed_is_in_the_unit_of_the_input():
    part = NonlinearPart(kind="rate_limit", at="command", size=3.0, std=0.1, reach=4.0)
    assert size_in_words(part, ("deg", "V")) == "at most 3.00 ± 0.10 deg/s"
    assert size_in_words(part, ("", "V")) == "at most 3.00 ± 0.10 per s"
