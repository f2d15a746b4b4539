"""Tutorial, guides and how-tos that make their own data are followed to the letter."""

from pathlib import Path

import pytest

import howto_files
from docs_following import follow

DOCS = Path(__file__).parents[2] / "docs"
PAGES = (
    "tutorial",
    "doubtful",
    "live",
    "software",
    "howto/motion-table",
    "howto/seeker",
    "howto/servo",
    "howto/drone",
    "howto/audio-loop",
    "howto/software",
    "howto/long-record",
)


@pytest.mark.parametrize("name", PAGES)
def test_a_page_does_what_it_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    follow(DOCS / f"{name}.md")
    if name == "tutorial":
        assert "Acceptance of unit 7" in Path("report.html").read_text(encoding="utf-8")
        assert "A. Tester" in Path("sheet.html").read_text(encoding="utf-8")
        assert Path("model/model.c").is_file()


def test_every_how_to_is_followed():
    there = {path.stem for path in (DOCS / "howto").glob("*.md")}
    followed = {name.partition("/")[2] for name in PAGES if "/" in name}
    assert there == followed | set(howto_files.FILES)
    for page in [DOCS / f"{name}.md" for name in PAGES]:
        assert "```" in page.read_text(encoding="utf-8"), page
