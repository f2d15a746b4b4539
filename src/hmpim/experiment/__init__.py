"""Run a stimulus on a rig, safely."""

from hmpim.experiment.run import run

__all__ = ["run"]
