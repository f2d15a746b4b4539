"""What is said about a file whose format has no use for it is refused, not ignored."""

import pytest

import hmpim
from hmpim.cli.main import app
from hmpim.errors import ArgumentError
from hmpim.formats.readers import Layout, check_used
from hmpim.formats.readers.registry import BUILT_IN

ROWS = "time,u,y\n" + "\n".join(f"{k / 100},{k % 7},{k % 5}" for k in range(200)) + "\n"


@pytest.mark.parametrize("command", ["channels", "identify", "compress", "validate"])
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--sheet", "Run 2"], "sheet = 'Run 2' is given, and 'a.csv' (text) has no sheets"),
        (["--stamps", "log"], "stamps = 'log' is given, and 'a.csv' (text) has one stamp"),
    ],
)
def test_a_table_of_text_has_neither_sheets_nor_two_stamps(command, words, said, tmp_path, capsys):
    file, result = tmp_path / "a.csv", tmp_path / "r.json"
    file.write_text(ROWS)
    given = [str(file)]
    if command == "validate":
        record = hmpim.read(file, inputs=["u"], outputs=["y"])
        hmpim.save(hmpim.identify(record, structures=["static"], intersample="zoh"), result)
        given.insert(0, str(result))
    if command in ("identify", "compress"):
        given += ["--input", "u", "--output", "y"]
    if command == "compress":
        given += ["-o", str(tmp_path / "s.h5")]
    assert app([command, *given, *words], standalone_mode=False) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1


def test_formats_with_sheets_or_two_stamps_are_known():
    uses = {reader.format: reader.uses for reader in BUILT_IN if reader.uses}
    assert uses == {
        "Excel": ("sheet",),
        "blackbox": ("sheet",),
        "ROS bag": ("stamps",),
        "ULog": ("stamps",),
    }


def test_stamps_may_be_those_of_a_file_beside():
    by_name = {reader.format: reader for reader in BUILT_IN}
    layout = Layout(stamps="header")
    check_used(layout, "a.csv", by_name["text"], beside=[by_name["ULog"]])
    with pytest.raises(ArgumentError, match="leave it out"):
        check_used(layout, "a.csv", by_name["text"], beside=[by_name["MATLAB"]])
