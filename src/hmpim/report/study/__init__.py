"""The page of a campaign."""

from hmpim.report.study.page import Grid, Section, StudyPage, render_study

__all__ = ["Grid", "Section", "StudyPage", "render_study"]
