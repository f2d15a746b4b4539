"""The documents as a site: every page has its place, every public name its entry."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import hmpim

DOCS = Path(__file__).parents[2] / "docs"


def test_the_table_of_contents_has_every_page_once():
    placed = []
    for block in re.findall(r"```{toctree}\n(.*?)```", (DOCS / "index.md").read_text(), re.DOTALL):
        placed += [line for line in block.splitlines() if line and not line.startswith(":")]
    assert len(placed) > 30
    assert len(set(placed)) == len(placed)
    there = [*DOCS.glob("*.md"), *DOCS.glob("howto/*.md"), DOCS / "decisions" / "index.md"]
    pages = {page.relative_to(DOCS).with_suffix("").as_posix() for page in there} - {"index"}
    assert set(placed) == pages


def test_every_public_name_has_its_entry():
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    first = text.partition("## `hmpim.plots`")[0]
    assert sorted(re.findall(r"\.\. auto\w+:: (\w+)", first)) == sorted(hmpim.__all__)


@pytest.mark.parametrize(
    ("name", "chapter"),
    [
        ("Layers of docs/architecture.md", "## Who may import whom"),
        ("Rooms of identification in docs/architecture.md", "### The rooms of identification"),
    ],
)
def test_the_layers_of_the_page_are_those_that_are_checked(name, chapter):
    project = (DOCS.parent / "pyproject.toml").read_text(encoding="utf-8")
    contract = project.partition(name)[2].partition("layers = [")[2].partition("]\n")[0]
    checked = [re.findall(r"\((\w+)\)", line) for line in contract.splitlines() if "(" in line]
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    block = page.partition(chapter)[2].partition("```text\n")[2].partition("```")[0]
    assert checked
    assert [line.split(" | ") for line in block.splitlines()] == checked


@pytest.mark.study
def test_the_site_is_built_without_a_warning_and_read_without_a_network(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, str(DOCS), str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    index = (tmp_path / "searchindex.js").read_text(encoding="utf-8")
    assert index.startswith("Search.setIndex(")
    assert "extinct" in index  # stems of words
    for page in tmp_path.rglob("*.html"):
        for loaded in re.findall(
            r'<(?:script|link|img)[^>]*(?:src|href)="([^"]+)"', page.read_text()
        ):
            assert not re.match(r"(https?:)?//", loaded), (page, loaded)
