from dataclasses import fields, replace

import pytest

from hmpim.identify import Estimate, PaperEstimates, Parameters
from hmpim.identify.judgement import judged
from hmpim.identify.result.groups import EVERY
from hmpim.record import Finding
from hmpim.report.untold import untold
from hmpim.report.words import GLOSSARY, headline, remark


def test_every_parameter_is_explained_and_every_figure_of_the_paper_has_its_reason():
    assert [w.name for w in GLOSSARY] == [f.name for f in fields(Parameters)]
    reasons = {w.name for w in GLOSSARY if w.differs}
    assert reasons == {f.name for f in fields(PaperEstimates)}


def bias():
    return next(words for words in GLOSSARY if words.name == "bias")


@pytest.mark.parametrize(
    ("paper", "begins"),
    [
        (0.6, "The two agree"),
        (0.6 + 0.019, "The two agree"),
        (0.6 + 0.021, "0.021 above: equation (11)"),
        (0.5, "0.1 below: equation (11)"),
        (None, "The paper's step gives no value"),
    ],
)
def test_two_figures_agree_within_two_standard_deviations_and_else_say_why(paper, begins):
    estimate = Estimate(value=0.6, std=0.01, ci95=(0.58, 0.62))
    assert remark(bias(), estimate, paper).startswith(begins)


def test_the_headline_is_the_verdict_of_the_worst_pair(found):
    pair = found.pairs[0]
    assert headline(found).startswith("Model identified: second-order dynamics and a delay")
    reason = Finding(
        code="unrelated",
        message="Output 'y' does not follow input 'u'.",
        severity="doubt",
        parameters=("delay",),
    )
    lost = replace(pair, verdict="not_identifiable", warnings=(reason,))
    assert headline(replace(found, pairs=(lost,))) == (
        "Not identifiable: output 'y' does not follow input 'u'."
    )
    assert headline(replace(found, pairs=(pair, lost))).endswith(
        "1 of 2 pairs can be used without reservation. Doubtful: u → y (not identifiable)."
    )
    late = doubting(pair, (("delay", "bias"), "It slips."))
    assert "Doubtful: u → y (delay, bias)." in headline(replace(found, pairs=(pair, late)))


def doubting(pair, *doubts):
    said = tuple(
        Finding(code="x", message=message, severity="doubt", parameters=names)
        for names, message in doubts
    )
    return judged(replace(pair, warnings=said))


def test_a_doubtful_pair_is_said_by_what_is_doubtful_and_why(found):
    late = (("delay",), "The delay may be 2 ms off.")
    vague = (("delay", "damping_ratio"), "A second pole may hide.")
    pair = found.pairs[0]
    assert headline(replace(found, pairs=(doubting(pair, late),))).endswith(
        "of the output. Delay is doubtful; the other figures are reliable. The delay may be "
        "2 ms off."
    )
    assert headline(replace(found, pairs=(doubting(pair, late, vague),))).endswith(
        "of the output. Delay and damping ratio are doubtful; the other figures are reliable. A "
        "second pole may hide."
    )


def test_a_unit_in_a_name_keeps_its_capitals_where_a_sentence_begins_with_it(found):
    doubted = doubting(found.pairs[0], (("bandwidth_3db",), "It slips."))
    assert "−3 dB bandwidth is doubtful;" in headline(replace(found, pairs=(doubted,)))


def test_where_most_is_doubtful_what_is_good_is_named(found):
    names = tuple(n for n in EVERY if n not in ("bias", "scale_factor"))
    text = headline(replace(found, pairs=(doubting(found.pairs[0], (names, "It slips.")),)))
    assert text.endswith("Only scale factor and bias are reliable. It slips.")
    text = headline(replace(found, pairs=(doubting(found.pairs[0], (EVERY, "It slips.")),)))
    assert text.endswith("No figure of the model is reliable. It slips.")


def test_a_unit_without_dynamics_is_not_said_to_have_any(found):
    still = replace(found.pairs[0], structure="static", parameters=Parameters(), fit_percent=97.0)
    assert headline(replace(found, pairs=(still,))).startswith(
        "Model identified: a scale factor explains 97.0 % of the output"
    )


def test_what_has_no_figure_is_listed(found):
    (pair,) = found.pairs
    none = replace(pair, structure="second_order", parameters=Parameters(), warnings=())
    said = untold(none)
    assert "Looked for and not found: a held output, saturation, rounding." in said
    for name in ("natural frequency", "damping ratio", "−3 dB bandwidth", "delay"):
        assert name in said
    assert "time constant" not in said  # its slowest poles may ring
    assert untold(replace(none, verdict="not_identifiable")) == ""


@pytest.mark.parametrize(
    ("structure", "lacking"),
    [
        ("static", ("natural frequency", "damping", "without delay", "−3 dB", "peak gain")),
        ("fir", ("natural frequency", "damping", "without delay", "−3 dB", "peak gain")),
        ("first_order", ("natural frequency", "damping", "without delay")),
        ("integrator_second_order", ("bandwidth", "peak gain")),
    ],
)
def test_figures_that_a_model_does_not_have_are_not_called_undetermined(found, structure, lacking):
    (pair,) = found.pairs
    said = untold(replace(pair, structure=structure, parameters=Parameters(), warnings=()))
    assert "scale factor" in said
    assert not [name for name in lacking if name in said]


def test_effects_are_not_called_absent_where_nobody_looked_or_one_is_there(found):
    (pair,) = found.pairs
    parts = Parameters(saturation_low=Estimate(value=-1.0, std=0.01, ci95=(-1.02, -0.98)))
    assert "not found: a held output, rounding." in untold(replace(pair, parameters=parts))
    blind = Finding(code="no_samples", message="", severity="info", parameters=())
    assert "not found" not in untold(replace(pair, parameters=parts, warnings=(blind,)))
