"""Tutorial, guides and how-tos that make their own data are followed to the letter."""

from pathlib import Path

import pytest

import howto_files
from docs_following import DOCS, FOLLOWED, blocks_of, follow


@pytest.mark.parametrize("name", FOLLOWED)
def test_a_page_does_what_it_says(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    follow(name)
    if name == "tutorial.md":
        assert "Acceptance of unit 7" in Path("report.html").read_text(encoding="utf-8")
        assert "A. Tester" in Path("sheet.html").read_text(encoding="utf-8")
        assert Path("model/model.c").is_file()


def test_every_how_to_is_followed():
    there = {f"howto/{path.name}" for path in (DOCS / "howto").glob("*.md")}
    followed = {name for name in FOLLOWED if name.startswith("howto/")}
    assert there == followed | {f"howto/{name}.md" for name in howto_files.FILES}
    assert all(blocks_of(name) for name in FOLLOWED)
