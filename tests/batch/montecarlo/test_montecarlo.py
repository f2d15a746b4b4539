"""Studies that depend on seed and plan alone, and are held against the bound."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.batch.montecarlo import read_plan, run, run_montecarlo, shipped_plan, sum_up
from hmpim.batch.montecarlo.draw import one_draw
from hmpim.batch.montecarlo.study import montecarlo_page
from hmpim.batch.pool import here_pool
from hmpim.plots import Rule
from hmpim.report.study import render_study

PLAN = """
name = "short"
seed = 3
draws = 4
regions = ["system.delay"]
[stimulus]
fs = 100
duration = 4
high = 15
[system]
structure = ["first_order", "second_order"]
delay = { uniform = [0.0, 0.1] }
natural_frequency = 4
damping_ratio = 0.5
[noise]
std = 0.02
"""


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    return read_plan(path)


def test_the_same_seed_gives_the_same_rows(plan, tmp_path, monkeypatch):
    """However the draws are cut into tasks, and in whichever order they come back."""
    one = run_montecarlo(plan, tmp_path / "a", pool=here_pool)
    monkeypatch.setattr(run, "_PER_TASK", 3)
    told = []
    other = run_montecarlo(
        plan, tmp_path / "b", pool=here_pool, progress=lambda done, total: told.append(done)
    )
    assert one.equals(other)
    assert told == [0, 3, 4]
    assert one.column("draw").to_pylist() == list(range(4))
    assert one.to_pylist()[2] == {**dict.fromkeys(one.column_names), **one_draw(plan, 2)}
    assert one_draw(replace(plan, seed=4), 2)["system.delay"] != one_draw(plan, 2)["system.delay"]
    again = []
    run_montecarlo(plan, tmp_path / "b", pool=None, progress=lambda d, t: again.append(d))
    assert again == [4]  # all there: nobody is asked to work

    found = sum_up(plan, one)
    assert found.draws == 4
    assert sum(map(sum, found.verdicts.values())) == 4
    assert sum(region.right_structure.count for region in found.regions) == 4

    assert "size: A4 landscape" in render_study(montecarlo_page(plan, found))
    bare = montecarlo_page(plan, replace(found, regions=()))
    assert "size: A4 portrait" in render_study(bare)  # one sheet, not two
    (errors, *_), *_ = (section.pictures for section in montecarlo_page(plan, found).sections)
    (panel,) = errors.figure.panels
    (rule,) = (item for item in panel.items if isinstance(item, Rule))
    assert (rule.label, rule.words) == ("bound", "")  # words on the line would touch a mark


@pytest.mark.few(12)
def test_the_bound_is_met(seeds, tmp_path):
    """Errors of an efficient estimator scatter as the bound says."""
    plan = replace(read_plan(shipped_plan("field")), draws=seeds)
    found = sum_up(plan, run_montecarlo(plan, tmp_path, pool=here_pool))
    by_name = {score.name: score for score in found.parameters}
    for name in ("delay", "natural_frequency", "damping_ratio", "scale_factor", "bias"):
        score = by_name[name]
        few = 4.0 / np.sqrt(2 * score.coverage.count)
        assert abs(score.over_bound - 1) < few, name
        assert score.coverage.high > 0.9, name
    assert found.right_structure.share == 1.0
    assert found.verdicts["ok"][1] == 0


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("seed = 3", "seed = -1", "seed = -1"),
        ("fs = 100", "speed = 100", r"\[stimulus\] has no 'speed'"),
        ("high = 15", "", "must say one of high and high_of_fs"),
        ("{ uniform = [0.0, 0.1] }", "{ even = [0, 1] }", "is neither a value nor a law"),
        ("system.delay", "system.bias", "is not a quantity that is drawn"),
        ('"first_order", ', '"third", ', "'third' is neither a value"),
        ("[noise]", "[noise", "is not a plan"),
        ("draws = ", "draws = true # ", "draws = True; give a whole number"),
        ("high = 15", "high = 60", r"high = 60 reaches the Nyquist frequency; stay below 50"),
        ("high = 15", "high_of_fs = 0.5", r"high_of_fs = 0.5 reaches the Nyquist frequency"),
        ("{ uniform = [0.0, 0.1] }", "[[0.1]]", r"delay = \[0.1\] is neither a value"),
        ("{ uniform = [0.0, 0.1] }", "[0.0, -0.1]", "delay = -0.1 is out of range"),
        ("{ uniform = [0.0, 0.1] }", "1000", "delay = 1000 s is as long as a record of"),
        ("[system]", "[system]\nscale_factor = 1e300", "scale_factor = 1e\\+300 is out of range"),
        ("[system]", "[system]\nscale_factor = 0", "scale_factor = 0 moves nothing"),
        ("natural_frequency = 4", "natural_frequency = 0", "natural_frequency = 0 is out of range"),
        ("[noise]", "[noise]\ncorrelation = 1.5", "correlation = 1.5 is out of range"),
    ],
)
def test_plans_that_are_wrong_are_refused(tmp_path, old, new, told):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN.replace(old, new, 1))
    with pytest.raises(hmpim.HmpimError, match=told):
        read_plan(path)
