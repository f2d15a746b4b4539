import json
import re
import xml.etree.ElementTree as ET

import pytest

from hmpim.report.paper import make_study, markdown_table, write_study
from hmpim.report.paper.write import render_page


@pytest.fixture(scope="module")
def study():
    return make_study([8, 13])


@pytest.fixture(scope="module")
def folder(study, tmp_path_factory):
    place = tmp_path_factory.mktemp("paper")
    write_study(study, place)
    return place


def test_files(folder):
    assert sorted(path.name for path in folder.iterdir()) == [
        "fig08.png",
        "fig08.svg",
        "fig13.png",
        "fig13.svg",
        "index.html",
        "table.json",
        "table.md",
    ]


def test_pictures_are_what_they_are_called(folder):
    png = (folder / "fig08.png").read_bytes()
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert int.from_bytes(png[16:20], "big") == round(7.6 * 150)
    assert ET.parse(folder / "fig08.svg").getroot().tag.endswith("svg")


def test_the_same_study_gives_the_same_bytes(folder, tmp_path):
    write_study(make_study([8]), tmp_path)
    for name in ("fig08.png", "fig08.svg"):
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_folder_is_used_again_and_what_is_not_ours_stays(study, folder, tmp_path):
    (tmp_path / "table.md").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    write_study(study, tmp_path)
    assert (tmp_path / "table.md").read_text() == (folder / "table.md").read_text()
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_tables_hold_the_rows(study, folder):
    assert (folder / "table.md").read_text(encoding="utf-8") == markdown_table(study.rows)
    data = json.loads((folder / "table.json").read_text(encoding="utf-8"))
    assert [row["quantity"] for row in data["rows"]] == [row.quantity for row in study.rows]
    assert [figure["files"] for figure in data["figures"]] == [
        ["fig08.png", "fig08.svg"],
        ["fig13.png", "fig13.svg"],
    ]


def test_page_needs_no_other_file_and_no_network(folder):
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 4  # of each picture one for a phone
    assert "http" not in page
    leads = re.findall(r'(?:src|href|url)\s*[=(]\s*"?([^")\s]+)', page)
    assert leads
    for outside in leads:
        assert outside.startswith("#"), outside
    assert "@import" not in page
    assert "<script" not in page


def test_links_of_the_page_lead_somewhere(study):
    page = render_page(study)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= set(ids)


def test_page_shows_captions_and_numbers(study):
    page = render_page(study)
    for row in study.rows:
        assert row.where in page
    assert "its peak is the pure delay" in page


def test_nothing_is_left_behind_where_a_folder_cannot_be(study, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        write_study(study, tmp_path / "file")
