"""What makes a page, and when, is worded in one place."""

from pathlib import Path

import hmpim
from hmpim.report.about import made_by


def test_one_place_states_what_made_a_page():
    label, value = made_by()
    assert value.startswith(f"hmpim {hmpim.__version__}, ")
    source = Path(hmpim.__file__).parent
    naming = [path for path in source.rglob("*.py") if f'"{label}"' in path.read_text("utf-8")]
    assert naming == [source / "report" / "about.py"]
