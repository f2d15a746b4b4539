"""One module for each page; `add_pages` puts them all into the application."""

from hmpim.workbench.pages.every import add_pages

__all__ = ["add_pages"]
