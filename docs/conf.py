"""Sphinx: the documents as a site, which is read from a folder and needs no network."""

import datetime
import re
from importlib.metadata import version as version_of

project = "hmpim"
author = "The hmpim developers"
copyright = f"{datetime.date.today().year}, {author}"
release = version = version_of("hmpim")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
exclude_patterns = ["build"]
source_suffix = {".md": "markdown"}
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]

autosummary_generate = False
autodoc_typehints = "none"  # the docstrings say them
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = "hmpim"
html_copy_source = False
html_show_sourcelink = False
# The summary of a hit is fetched, which a browser refuses to a page that is a file.
html_show_search_summary = False
html_theme_options = {"navigation_with_keys": True}

default_role = "literal"
_ROLE_IN_A_WORD = re.compile(r"(`[^`\n]+`)(?=\w)")


def setup(app):
    """Part what stands in backquotes from letters that follow it, as docutils wants it."""

    def apart(app, what, name, obj, options, lines):
        lines[:] = [_ROLE_IN_A_WORD.sub(r"\1\\ ", line) for line in lines]

    app.connect("autodoc-process-docstring", apart, priority=100)
