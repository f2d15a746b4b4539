"""One page for a study: a campaign, a batch, or several records of one test."""

from hmpim.report.study.page import Grid, Section, StudyPage, render_study
from hmpim.report.study.paper import study_pdf, write_study_page

__all__ = ["Grid", "Section", "StudyPage", "render_study", "study_pdf", "write_study_page"]
