"""Input design: what a stimulus will tell, and the gentlest one that tells enough."""

from hmpim.optimal.candidate import Candidate, gentleness
from hmpim.optimal.fisher import Errors, fisher_information, predict_errors, sensitivities
from hmpim.optimal.gentlest import FAMILIES, Gentlest, TradePoint, gentlest, trade
from hmpim.optimal.wish import PARAMETERS, Accuracy, Family, Gentle, ModelRange, RoughModel, Wish

__all__ = [
    "FAMILIES",
    "PARAMETERS",
    "Accuracy",
    "Candidate",
    "Errors",
    "Family",
    "Gentle",
    "Gentlest",
    "ModelRange",
    "RoughModel",
    "TradePoint",
    "Wish",
    "fisher_information",
    "gentleness",
    "gentlest",
    "predict_errors",
    "sensitivities",
    "trade",
]
