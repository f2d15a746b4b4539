"""Monte Carlo studies: systems, stimuli and noise drawn, identified, held against the truth."""

from hmpim.batch.montecarlo.plan import PLANS, Plan, read_plan, shipped_plan
from hmpim.batch.montecarlo.run import run_montecarlo
from hmpim.batch.montecarlo.study import montecarlo_page
from hmpim.batch.montecarlo.summary import MonteCarlo, sum_up

__all__ = [
    "PLANS",
    "MonteCarlo",
    "Plan",
    "montecarlo_page",
    "read_plan",
    "run_montecarlo",
    "shipped_plan",
    "sum_up",
]
