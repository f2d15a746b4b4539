"""Models for other tools, written from a result with its error bars and its origin."""

from hmpim.formats.models.export import TARGETS, Target, export
from hmpim.formats.models.nonlinear import LinearPartOnly
from hmpim.formats.models.source import Source, source_of

__all__ = ["TARGETS", "LinearPartOnly", "Source", "Target", "export", "source_of"]
