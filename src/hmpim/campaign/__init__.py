"""Section V: a whole study from one plan."""

from hmpim.campaign.case import Case
from hmpim.campaign.cases import expand
from hmpim.campaign.plan import Plan, parse_plan, read_plan
from hmpim.campaign.rig import Player
from hmpim.campaign.run import run_campaign
from hmpim.campaign.shipped import PLANS, shipped_plan

__all__ = [
    "PLANS",
    "Case",
    "Plan",
    "Player",
    "expand",
    "parse_plan",
    "read_plan",
    "run_campaign",
    "shipped_plan",
]
