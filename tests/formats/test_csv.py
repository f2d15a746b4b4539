"""CSV to records and back: what is understood, what is refused, and in which words."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, FormatError, RecordError, UnitError
from hmpim.formats import read, write_csv
from hmpim.record import Channel, Finding, Record, uniform
from tests_support import examples

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data"
GAPS = Finding(code="gaps", message="3 are missing", severity="info", parameters=("delay",))
PLAIN = "time,u,y\n0,1,2\n0.1,3,4\n0.2,5,6\n"


@pytest.fixture
def file(tmp_path):
    def make(content, name="test.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return make


def arrays(record):
    return {c.name: c.values.tolist() for c in (*record.inputs, *record.outputs)}


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\r"),
        b"\xef\xbb\xbf" + PLAIN.encode(),
        PLAIN.rstrip("\n"),
        "# bench 2; run 7\n\n" + PLAIN.replace("\n", "\n\n# note, with comma\n"),
        '"time","u","y"\n"0","1","2"\n"0.1","3","4"\n"0.2","5","6"\n',
        " time , u , y \n 0 , 1 , 2 \n 0.1 , 3 , 4 \n 0.2 , 5 , 6 \n",
        "y,Time,U\n2,0,1\n4,0.1,3\n6,0.2,5\n",
        "note,u,t,y\nstart,1,0,2\n,3,0.1,4\nend,5,0.2,6\n",
        'note,u,t,y\n"a,b",1,0,2\n,3,0.1,4\nend,5,0.2,6\n',
        "time,u,y,\n0,1,2,\n0.1,3,4,\n0.2,5,6,\n",
        "# from numpy\n# time,u,y\n0,1,2\n0.1,3,4\n0.2,5,6\n",
        "time [ms],u,y\n0,1,2\n100,3,4\n200,5,6\n",
        "time (us),u,y\n0,1,2\n1e5,3,4\n2e5,5,6\n",
    ],
    ids=[
        *("comma", "semicolon", "tab", "crlf", "cr", "bom", "no-last-newline", "comments"),
        *("quotes", "blanks", "order-and-case", "text-column", "comma-in-quotes"),
        *("empty-last-column", "heading-in-comment", "ms", "us"),
    ],
)
def test_every_dialect_gives_the_same_record(file, content):
    record = read(file(content))
    assert [v for _, v in sorted((k.lower(), v) for k, v in arrays(record).items())] == [
        [1, 3, 5],
        [2, 4, 6],
    ]
    assert record.inputs[0].name.lower() == "u"
    assert record.inputs[0].time.tolist() == [0.0, 0.1, 0.2]
    assert record.fs == pytest.approx(10, rel=1e-12)


def test_units_are_taken_from_the_heading(file):
    record = read(file("time [s],u [deg],y (V)\n0,1,2\n1,3,4\n"))
    assert [(c.name, c.unit) for c in (*record.inputs, *record.outputs)] == [
        ("u", "deg"),
        ("y", "V"),
    ]


def test_what_pint_does_not_know_stays_in_the_name_if_in_parentheses(file):
    record = read(file("time,u,y (filtered)\n0,1,2\n1,3,4\n"), outputs=["y (filtered)"])
    assert (record.outputs[0].name, record.outputs[0].unit) == ("y (filtered)", "")


def test_a_dash_in_brackets_is_no_unit(file):
    assert read(file("time,u [-],y\n0,1,2\n1,3,4\n")).inputs[0].unit == ""


def test_stated_units_go_before_those_of_the_heading(file):
    path = file("time,u [deg],y\n0,1,2\n1,3,4\n")
    record = read(path, units={"u": "rad", "y": "V"})
    assert (record.inputs[0].unit, record.outputs[0].unit) == ("rad", "V")


def test_a_rate_replaces_the_time_column(file):
    record = read(file("u,y\n1,2\n3,4\n5,6\n"), fs=20.0)
    assert record.inputs[0].time.tolist() == [0.0, 0.05, 0.1]


def test_columns_are_found_by_name_or_heading(file):
    path = file("stamp;a [V];b [V];c\n0;1;2;3\n1;4;5;6\n")
    record = read(path, time="stamp", inputs=["c"], outputs=["b [V]", "a"])
    assert arrays(record) == {"c": [3, 6], "b": [2, 5], "a": [1, 4]}


def test_a_spoilt_cell_in_a_column_that_is_not_asked_for_does_no_harm(file):
    record = read(file("time,u,y,x\n0,1,2,nan\n1,3,4,\n"))
    assert arrays(record) == {"u": [1, 3], "y": [2, 4]}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("time,u,y\n0,1,2\n0.1,nan,4\n", r"channel 'u' holds 1 numbers in 2 samples"),
        ("time,u,y\n0,1,2\n0.1,3,OL\n", "line 3, column 'y' holds 'OL', which is not a number"),
        ("time,u,y\n0,0,1,0,2,0\n0,1,3,0,4,0\n", "decimal comma is not a delimiter"),
        ("time,u,y\n0,1,2\n0.1,3\n0.2,5,6\n", "line 3 has 2 cells where 3 are needed; correct"),
        ("time,u,y\n", r"has column names \(time, u, y\) and no samples"),
        ("time,u,y\n0,1,2\n", "holds one sample"),
        ("", "'test.csv' is empty"),
        ("\n \n", "'test.csv' is empty"),
        ("# only\n# words\n", "holds comments only"),
        ("time,u,y,u\n0,1,2,3\n1,3,4,5\n", "has two columns 'u'"),
        ("time,u [deg],u [rad],y\n0,1,2,3\n1,3,4,5\n", "has two columns 'u'"),
        ('time,u,y\n0,1,"2,' + 200000 * "2", "cannot be cut into cells"),
        (
            b"\x7fELF\x00\x00\x01\x02time,u,y\n",
            "binary file that starts with the bytes 7f 45 4c 46",
        ),
        (b"time,u,y\n0,1,\x81\xfe\n", "line 2 holds the byte 0x81, which is not UTF-8"),
        (b"time,u,y\n0,1,\x00\xfe\n", "is a binary file"),
        ("word\nword\nword\n", "holds no rows of numbers"),
        ('{"schema": "hmpim/identification/2"}\n', "holds JSON and .* with hmpim report"),
        ('{"time":{"0":0.0,"1":0.1},"u":{"0":1,"1":2},"y":{"0":1,"1":3}}', "export the samples"),
        ("[[0,1,2],[1,3,4],[2,5,6]]", "holds JSON and no table"),
        (
            "time,a,b\n0,1,2\n1,3,4\n",
            r"which column is the input; its columns are a, b: .*--input a",
        ),
        ("time,u\n0,1\n1,3\n", "has no column for the output; its columns are u, and an input and"),
        ("time,u,position\n0,1,2\n1,3,4\n", "2 columns that may be the input"),
        (
            "time,position,velocity,acceleration\n0,1,2,3\n1,3,4,5\n",
            "as a stimulus does, and no output is named; play it with hmpim run",
        ),
        (
            "t;u;y\n0;999;1,025\n1;500;2,050\n2;250;999\n3;125;-1,250\n",
            "column 'y' holds '1,025' and '999': its commas mark thousands; export the file",
        ),
        (
            "t;u;y\n0.1;999;1.5\n0.2;500;1.25\n0.3;1,025.67;3.5\n",
            "line 4, column 'u' holds '1,025.67', with marks for thousands",
        ),
        ("time,u,b\n0,1,2\n1,3,4\n", r"which column is the output; .*--output b"),
        ("time,u,command,y\n0,1,2,3\n1,3,4,5\n", r"2 columns that may be the input \(u, command\)"),
        ("u,y\n1,2\n3,4\n", r"no column time or t among u, y; give the rate .*--fs"),
        ("t,time,u,y\n0,0,1,2\n1,1,3,4\n", r"several time columns \(t, time\)"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(file, content, words):
    with pytest.raises((FormatError, RecordError), match=words):
        read(file(content))


def test_fractions_of_three_digits_are_no_thousands(file):
    """A decimal comma stays one where a number below one, or another count of digits, tells it."""
    for cells in (("1,025", "2,050", "0,999"), ("1,025", "2,05", "-1,250"), ("5", "1,025", "2")):
        rows = "".join(f"{k};{cell};{cell}\n" for k, cell in enumerate(cells))
        found = read(file("t;u;y\n" + rows)).inputs[0].values.tolist()
        assert found == [float(cell.replace(",", ".")) for cell in cells]


def test_samples_out_of_order_are_sorted_and_counted(file):
    record = read(file("time,u,y\n0,1,2\n0.2,3,4\n0.1,5,6\n0.1,5,7\n0.3,7,8\n"))
    assert record.inputs[0].time.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert arrays(record) == {"u": [1, 5, 3, 7], "y": [2, 6, 4, 8]}
    codes = [f.code for f in record.findings]
    assert codes == ["backward_stamps", "doubled_stamps", "assumed_roles"]
    assert "at 1 of 5 samples" in record.findings[0].message
    assert "1 of 5 stamps of 'u', 'y'" in record.findings[1].message


def test_missing_cells_are_gaps_of_their_channel_alone(file):
    rows = "".join(f"{k / 10},{k},{'nan' if k in (3, 4) else -k}\n" for k in range(20))
    record = read(file("time,u,y\n" + rows.replace("7,-7", "7,inf").replace("9,-9", "9,nan")))
    assert record.inputs[0].values.size == 20
    assert record.outputs[0].values.tolist() == [-k for k in range(20) if k not in (3, 4, 7, 9)]
    finding, _ = record.findings
    assert finding.code == "missing_samples"
    assert "4 of 20 samples of 'y' are missing (1 of them infinite), in 3 places" in finding.message
    aligned = uniform(record)
    assert np.flatnonzero(~aligned.outputs[0].valid).tolist() == [3, 4, 7, 9]
    assert aligned.inputs[0].valid.all()


def test_a_recording_that_starts_again_is_refused(file):
    rows = "".join(f"{k % 30},{k},{k}\n" for k in range(60))
    with pytest.raises(RecordError, match=r"time starts again in .*: the file holds 2 recordings"):
        read(file("time,u,y\n" + rows))


def test_time_that_runs_backward_or_stands_still_is_said(file):
    rows = [f"{k},{k},{k}\n" for k in range(30)]
    with pytest.raises(
        RecordError, match=r"backward from the first sample \(29 s\) to the last \(0 s\); sort"
    ):
        read(file("time,u,y\n" + "".join(reversed(rows))))
    with pytest.raises(RecordError, match="time of 'u', 'y' stands still: all 30 samples"):
        read(file("time,u,y\n" + "".join(f"7,{k},{k}\n" for k in range(30))))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": ["x"]}, "has no column 'x'; its columns are u, y"),
        ({"outputs": ["x"]}, "has no column 'x'; its columns are u, y"),
        ({"time": "x"}, "has no time column 'x'; its columns are time, u, y"),
    ],
)
def test_a_missing_column_lists_those_there(file, options, words):
    with pytest.raises(FormatError, match=words):
        read(file(PLAIN), **options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"inputs": ["u"], "outputs": ["u"]}, "'u' is named as input and as output"),
        ({"inputs": ["u", "u"]}, "'u' is named twice"),
        ({"units": {"x": "deg"}}, "unit is given for 'x', which is not a column"),
        ({"fs": 0.0}, "fs = 0.0 Hz"),
        ({"fs": float("nan")}, "fs = nan Hz"),
    ],
)
def test_contradictory_options_are_refused(file, options, words):
    with pytest.raises(ArgumentError, match=words):
        read(file(PLAIN), **options)


@pytest.mark.parametrize(
    ("heading", "words"),
    [
        ("time,u [furlongz],y", r"column 'u \[furlongz\]'.*is not known"),
        ("time [deg],u,y", "'deg' is not a unit of time"),
    ],
)
def test_units_that_cannot_be(file, heading, words):
    with pytest.raises(UnitError, match=words):
        read(file(f"{heading}\n0,1,2\n1,3,4\n"))


def test_absent_file_and_folder(tmp_path):
    with pytest.raises(FormatError, match=r"there is no file .*absent\.csv"):
        read(tmp_path / "absent.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(FormatError, match="is a folder"):
        read(tmp_path / "folder.csv")


def test_content_says_what_a_file_is_whatever_its_name(file):
    assert read(file(PLAIN, "test.xyz")).sha256 == read(file(PLAIN)).sha256


FLOATS = st.floats(allow_nan=False, allow_infinity=False)
NAMES = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
UNITS = st.sampled_from(["", "deg", "deg/s²", "V", "N*m"])


@examples(20)
@given(data=st.data(), fs=st.floats(1e-3, 1e6), n=st.integers(2, 20))
def test_written_and_read_back_is_the_same_bit_for_bit(tmp_path_factory, data, fs, n):
    names = data.draw(st.lists(NAMES, min_size=2, max_size=4, unique=True))
    samples = st.lists(FLOATS, min_size=n, max_size=n)
    # Stamps 10 million samples apart are refused, as damaged ones.
    steps = data.draw(st.lists(st.floats(1e-3, 1.0), min_size=n, max_size=n))
    stamps = data.draw(st.floats(-1e3, 1e3)) + np.cumsum(steps)
    channels = tuple(
        Channel(name=name, time=stamps, values=data.draw(samples), unit=data.draw(UNITS))
        for name in names
    )
    split = data.draw(st.integers(1, len(names) - 1))
    record = Record(
        inputs=channels[:split],
        outputs=channels[split:],
        fs=fs,
        band=data.draw(st.none() | st.tuples(st.floats(0, 1), st.floats(1, 9))),
        intersample=data.draw(st.sampled_from([None, "zoh", "foh", "bandlimited", "sampled"])),
        source=data.draw(NAMES),
    )
    path = tmp_path_factory.mktemp("round") / "record.csv"
    write_csv(record, path)
    back = read(path)
    assert back.sha256 == record.sha256  # names, units, stamps and values of every channel
    assert (back.fs, back.band, back.intersample, back.source) == (
        record.fs,
        record.band,
        record.intersample,
        record.source,
    )
    assert [p.name for p in path.parent.iterdir()] == ["record.csv"]


@examples(60)
@given(content=st.binary(max_size=200) | st.text('0123456789,;.\n\r\t-#"eu[]ty ', max_size=80))
@example(content=b'"\n"')
@example(content='t,u,y\n"0,1,2\n0,1,2')
def test_any_content_is_read_or_refused_in_our_own_words(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "any.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    try:
        record = read(path)
    except (FormatError, RecordError, UnitError):
        return  # any other error fails the test
    assert record.samples >= 2


def test_every_role_comes_back_and_a_person_may_choose_otherwise(tmp_path):
    steps = np.arange(5.0)
    record = Record.from_arrays(
        {"u": steps},
        {"y": 2 * steps},
        fs=10.0,
        references={"r": steps + 1 / 3},
        auxiliary={"t": steps - 1, "time": steps**2},
        units={"t": "degC"},
    )
    record = replace(record, findings=(GAPS,))
    write_csv(record, tmp_path / "r.csv")
    assert read(tmp_path / "r.csv") == record
    other = read(tmp_path / "r.csv", inputs=["r"], outputs=["y"])
    assert [c.name for c in other.inputs] == ["r"]
    assert other.references == ()
    assert [c.name for c in other.auxiliary] == ["t", "time"]
    named = read(tmp_path / "r.csv", inputs=["u"], references=["t"], auxiliary=["r"])
    assert [c.name for c in named.references] == ["t"]
    assert [c.name for c in named.auxiliary] == ["r"]
    with pytest.raises(ArgumentError, match="'u' is named as input and as reference"):
        read(tmp_path / "r.csv", inputs=["u"], references=["u"])


def test_roles_that_were_assumed_are_said_and_those_that_were_not_are_not(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text("time,u,y\n" + "".join(f"{k / 10},{k % 3},{k}\n" for k in range(20)))
    (finding,) = read(path).findings
    assert (finding.code, finding.severity) == ("assumed_roles", "info")
    assert finding.message == (
        "'u' is taken as the input and 'y' as the output, by name. Choose another channel "
        "with --input or --output (in Python: inputs=[...] or outputs=[...])."
    )
    (finding,) = read(path, inputs=["u"]).findings
    assert finding.message == (
        "'y' is taken as the output, by name. Choose another channel with --output "
        "(in Python: outputs=[...])."
    )
    assert read(path, inputs=["u"], outputs=["y"]).findings == ()
    write_csv(read(path, inputs=["u"], outputs=["y"]), tmp_path / "ours.csv")
    assert read(tmp_path / "ours.csv").findings == ()


def test_channels_with_clocks_of_their_own_do_not_fit_a_table(tmp_path):
    u = Channel(name="u", time=[0.0, 1.0, 2.0], values=[1.0, 2.0, 3.0])
    y = Channel(name="y", time=[0.5, 1.5, 2.5], values=[1.0, 2.0, 3.0])
    record = Record(inputs=(u,), outputs=(y,), fs=1.0)
    with pytest.raises(RecordError, match="'y' has a clock of its own"):
        write_csv(record, tmp_path / "test.csv")
    assert list(tmp_path.iterdir()) == []


def test_an_edited_file_is_read_by_its_headings(tmp_path):
    path = tmp_path / "test.csv"
    write_csv(Record.from_arrays({"a": [0, 1]}, {"b": [2, 3]}, fs=10.0), path)
    path.write_text(path.read_text().replace("time [s],a,b", "time [s],u,y"))
    assert arrays(read(path)) == {"u": [0, 1], "y": [2, 3]}


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "samples"), [("prbs", 29696), ("square_step", 5000)])
def test_measured_circuit(name, samples):
    path = DATA / "rcrc" / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"no measured record at {path}")
    record = read(path)
    truth = np.genfromtxt(path, delimiter=",", skip_header=1)
    assert record.samples == len(truth)
    assert (record.inputs[0].name, record.outputs[0].name) == ("input", "output")
    assert np.array_equal(record.outputs[0].values, truth[:, 2])
    assert record.fs == 1000.0
    aligned = uniform(record)
    assert [f.code for f in aligned.findings] == ["assumed_roles"]
    assert aligned.inputs[0].values is record.inputs[0].values
