"""Names of files from a browser: always a plain name, inside the folder, never taken twice."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.workbench.names import free_place, harmless_name
from tests_support import examples

HOSTILE = [
    "../../.ssh/authorized_keys", "..\\..\\boot.ini", "/etc/passwd", "C:\\a\\b.csv", "", ".", "..",
    "a\x00b.csv", "a\nb.csv", "-rf", "con", "LPT1.csv", "x" * 5000, "é\u202egpj.csv",
    "<img src=x onerror=alert(1)>.csv", ".bashrc", "a.csv ", "~/x", "$(reboot).csv",
]  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_becomes_a_plain_one(name):
    made = harmless_name(name)
    assert made == Path(made).name
    assert 0 < len(made.encode()) <= 255
    assert not set(made) & set('<>:"/\\|?*\x00\n$`~')
    assert not made.startswith(".")
    assert made.isprintable()
    assert made.split(".")[0].lower() not in ("con", "lpt1")


@examples(25)
@given(st.text(max_size=300))
def test_any_name_stays_inside_its_folder_and_is_settled(name):
    made = harmless_name(name)
    assert Path("/folder", made).resolve().parent == Path("/folder").resolve()
    assert harmless_name(made) == made


def test_no_file_is_ever_replaced(tmp_path):
    (tmp_path / "a.csv").write_text("mine")
    assert free_place(tmp_path, "../a.csv").name == "a-2.csv"
    assert free_place(tmp_path, "a.csv").name == "a-3.csv"
    assert (tmp_path / "a.csv").read_text() == "mine"
