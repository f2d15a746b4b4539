"""Tables of text as instruments, loggers and spreadsheets write them: the same numbers out."""

import codecs
import gzip
from itertools import product

import numpy as np
import pytest

from hmpim.errors import FormatError, UnitError
from hmpim.formats import read
from hmpim.formats.readers import Layout, reader_for
from hmpim.formats.readers.text import source
from tests_support import in_studies

N = 300
K = np.arange(N)


def rows(form, **formats):
    """Rows of k, t = k/1000 s, a = k/10, b = -k/4 in the given form."""
    return "".join(form.format(k=k, t=k / 1000, a=k / 10, b=-k / 4) for k in range(N))


def german(text):
    return text.replace(".", ",")


TEKTRONIX_MSO = (
    "Model,MSO54B\nFirmware Version,1.2.3\n,\nWaveform Type,ANALOG\nHorizontal Units,s\n"
    "Sample Interval,3.2e-09\nRecord Length,300\nGating,0.0% to 100.0%\nProbe Attenuation,10,1\n"
    "Vertical Units,V,A\nVertical Offset,0,0\nVertical Scale,0.1,1\nVertical Position,0,0\n,\n"
    "Label,,\nTIME,CH1,CH2\n"
)
TEKTRONIX_TDS = "".join(
    f"{fact},,{k / 1000:.6f},{k / 10:.5f},\n"
    for k, fact in enumerate(
        ["Record Length,300", "Sample Interval,1e-3", "Trigger Point,150", ",", "Source,CH2"]
        + ["Vertical Units,V"]
        + [","] * (N - 6)
    )
)
SIGLENT = (
    "Record Length,Analog:7000\nSample Interval,Analog:1e-9\nVertical Units,CH1:V\n"
    "Vertical Scale,CH1:2.00\nHorizontal Units,s\nModel Number,SDS1202X-E\nSource,CH1\n"
    "Second,Volt\n"
)
LECROY = (
    "LECROYWR64Xi,38463,Waveform\nSegments,1,SegmentSize,300\n"
    "Segment,TrigTime,TimeSinceSegment1\n#1,25-Aug-2010 12:03:00,0                 \nTime,Ampl\n"
)
LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "Date\t2026/11/21\nTime\t12:00:00.5\n***End_of_Header***\t\n\nChannels\t2\t\t\n"
    "Samples\t300\t300\t\nTime\t12:00:00.5\t12:00:00.5\t\nY_Unit_Label\tVolts\tAmps\t\n"
    "X_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0\t\nDelta_X\t1.0E-3\t1.0E-3\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tVoltage\tCurrent\tComment\n"
)
BETAFLIGHT = (
    '"Product","Blackbox flight data recorder by Nicholas Sherlock"\n"firmwareType","Cleanflight"\n'
    '"looptime","125"\n"rollPID","45,80,30"\n"loopIteration","time","axisP[0]","gyroADC[0]"\n'
)
DIGILENT = (
    "#Digilent WaveForms Oscilloscope Acquisition\n#Device Name: Discovery2\n#Samples: 300\n"
    "#Trigger: Ch1 at 0\n\nTime (s),Channel 1 (V),Channel 2 (V)\n"
)
PLAIN = rows("{t:.6f},{a:.5f},{b:.5f}\n")
UV = {"a": "", "b": ""}

LONG = b"time,u,y\n" + (b"0,1,2" + b" " * 150 + b"\n") * 40_000  # of several blocks
MANY = b"time,u,y\n" + b"0,1,2\n" * 100_000

# Name: (text, name of time, {channel: unit} for a and b, or for a alone).
TEXTS = {
    "tektronix-mso": (TEKTRONIX_MSO + PLAIN, "TIME", {"CH1": "V", "CH2": "A"}),
    "tektronix-tds": (TEKTRONIX_TDS, "time", {"CH2": "V"}),
    "keysight": (
        "x-axis,1,2\nsecond,Volt,Amp\n" + rows("{t:+.4E},{a:+.4E},{b:+.4E}\n"),
        "x-axis",
        {"1": "V", "2": "A"},
    ),
    "rigol-old": (
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,0.0e-03,1.0e-03\n"
        + rows("{k},{a:.3e},{b:.4e},,\n"),
        "time",
        {"CH1": "V", "CH2": "V"},
    ),
    "rigol-new": (
        "A,B, t0 =0.000000e-03, tInc = 1.000000e-03,\n" + rows("{a:.3e},{b:.4e},,\n"),
        "time",
        {"A": "", "B": ""},
    ),
    "siglent": (SIGLENT + rows("{t:.12f},{a:.5f}\n"), "Source", {"CH1": "V"}),
    "lecroy": (LECROY + rows("{t:.8f},{a:.5f}\n"), "Time", {"Ampl": ""}),
    "picoscope": (
        "Time,Channel A,Channel B\n(ms),(mV),(V)\n\n" + rows("{k:.8f},{a:.5f},{b:.3f}\n"),
        "Time",
        {"Channel A": "mV", "Channel B": "V"},
    ),
    "picoscope-german": (
        "Zeit;Kanal A;Kanal B\n(ms);(mV);(V)\n\n" + german(rows("{k:.8f};{a:.5f};{b:.3f}\n")),
        "Zeit",
        {"Kanal A": "mV", "Kanal B": "V"},
    ),
    "rohde-schwarz": (
        "in s,C1 in V,C2 in mV\n" + rows("{t:.8e},{a:.5f},{b:.3f}\n"),
        "time",
        {"C1": "V", "C2": "mV"},
    ),
    "digilent": (DIGILENT + PLAIN, "Time", {"Channel 1": "V", "Channel 2": "V"}),
    "labview": (
        LABVIEW + rows("{t:.6f}\t{a:.5f}\t{b:.3f}\t\n"),
        "X_Value",
        {"Voltage": "V", "Current": "A"},
    ),
    "betaflight": (
        BETAFLIGHT + rows("{k},{k}000,{a},{b}\n"),
        "time",
        {"axisP[0]": "", "gyroADC[0]": ""},
    ),
    "klipper": ("#time,a,b\n" + PLAIN, "time", UV),
    "savetxt": ("# t a b\n" + rows("{t:.18e} {a:.18e} {b:.18e}\n"), "t", UV),
    "matlab": ("% t, a, b\n" + rows("{t:.4e}, {a:.4e}, {b:.4e}\n"), "t", UV),
    "iso": (
        "timestamp,a,b\n" + rows("2026-11-21T12:00:00.{k:03d}Z,{a},{b}\n"),
        "timestamp",
        UV,
    ),
    "dates-german": (
        "Datum;a [°];b [°/s]\n"
        + german(rows("21/11/2026 12:00:00.{k:03d};{a};{b}\n")).replace("/", "."),
        "Datum",
        {"a": "deg", "b": "deg/s"},
    ),
    "unix-ms": (
        "timestamp,a,b\n" + "".join(f"{1763726400000 + k},{k / 10},{-k / 4}\n" for k in K),
        "timestamp",
        UV,
    ),
    "unix-ns": (
        "timestamp,a,b\n"
        + "".join(f"{1763726400 * 10**9 + k * 10**6},{k / 10},{-k / 4}\n" for k in K),
        "timestamp",
        UV,
    ),
    "unix-s": (
        "Time,a,b\n" + "".join(f"{1763726400}.{k:03d},{k / 10},{-k / 4}\n" for k in K),
        "Time",
        UV,
    ),
    "pandas-index": (",time,a,b\n" + rows("{k},{t},{a},{b}\n"), "time", UV),
    "sep": (
        "sep=;\r\nt [s];a [V];b [V]\r\n" + german(rows("{t};{a};{b}\r\n")),
        "t",
        {"a": "V", "b": "V"},
    ),
    "quoted-decimal-comma": (
        '"t","a","b"\n' + german(rows('"{t}"|"{a}"|"{b}"\n')).replace("|", ","),
        "t",
        UV,
    ),
    "tabs": ("time\ta\tb\n" + rows("{t}\t{a}\t{b}\n"), "time", UV),
    "pipes": ("| time | a | b |\n" + rows("| {t} | {a} | {b} |\n"), "time", UV),
    "blanks-decimal-comma": (
        "t   a   b\n" + german(rows("  {t:.3f}   {a:.2f}   {b:.2f}\n")),
        "t",
        UV,
    ),
    "empty-columns": ("time,a,,b,\n" + rows("{t},{a},,{b},\n"), "time", UV),
    "units-below": ("time,a,b\nms,deg,-\n" + rows("{k},{a},{b}\n"), "time", {"a": "deg", "b": ""}),
    "units-in-brackets-below": (
        "time,a,b\n[ms],[mm/s],[m/s2]\n" + rows("{k},{a},{b}\n"),
        "time",
        {"a": "mm/s", "b": "m/s**2"},
    ),
    "us": ("Time [µs],a,b\n" + rows("{k}000,{a},{b}\n"), "Time", UV),
    "ms-in-name": ("time_ms,a,b\n" + rows("{k},{a},{b}\n"), "time_ms", UV),
    "comments-within": (
        "time,a,b\n" + PLAIN.replace("0.010000", "# pause\n\n0.010000"),
        "time",
        UV,
    ),
}


def opened(path, layout=None):
    layout = layout or Layout()
    reader = reader_for(path)
    return reader, reader.channels(path, layout)


@pytest.mark.parametrize("name", TEXTS)
def test_every_writing_gives_the_same_numbers(tmp_path, name):
    text, time, channels = TEXTS[name]
    path = tmp_path / "run"
    path.write_bytes(text.encode())
    reader, contents = opened(path)
    assert contents.time == time
    units = {c.name: c.unit for c in contents.channels}
    assert {name: units[name] for name in channels} == channels
    series = reader.read(path, list(channels), Layout())
    wanted = [K / 10, -K / 4][: len(channels)]
    for s, values in zip(series, wanted, strict=True):
        assert np.array_equal(s.values, values)
        # Dates and Unix time count from a whole second, with no digit lost.
        assert np.abs(s.time - K / 1000).max() < 1e-15
    assert sum(not c.holds for c in contents.channels) - len(channels) <= 2


RESTS = [(1, 0), (1499, 0), (1600, 0), (70_000, 0), (0, 200), (0, 3000)]
"""How many samples a command rests before it moves, and after."""
DELIMITERS = [";", "\t", " ", '","']
RESTING = [(*rest, DELIMITERS[k % 3]) for k, rest in enumerate(RESTS)]
RESTING += [(1600, 0, '","'), (0, 3000, '","')]
"""Each rest and each delimiter; the other pairs in `make studies`."""
OTHERS = [(*r, d) for r, d in product(RESTS, DELIMITERS) if (*r, d) not in RESTING]


@pytest.mark.parametrize(("before", "after", "delimiter"), [*RESTING, *in_studies(*OTHERS)])
def test_whole_numbers_do_not_hide_a_decimal_comma(tmp_path, delimiter, before, after):
    """A command that rests at 0 before or after it moves, in any length of file."""
    values = np.round(np.sin(np.arange(20) / 3), 3)
    whole = np.concatenate([np.zeros(before), values, np.zeros(after)])
    quote = delimiter.strip(";\t ")[:1]
    cells = [f"{k:g}".replace(".", ",") for k in whole]
    lines = [quote + delimiter.join(("u", "y")) + quote]
    lines += [quote + cell + delimiter + cell + quote for cell in cells]
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines) + "\n")
    record = read(path, inputs=["u"], outputs=["y"], fs=100.0)
    assert np.array_equal(record.outputs[0].values, whole)
    path.write_text("\n".join([*lines, quote + delimiter.join(("0.5", "1")) + quote]))
    bad = f"line ({before + 3}|{len(lines) + 1}), column 'u' holds '0[.,]"
    with pytest.raises(FormatError, match=bad):
        read(path, inputs=["u"], outputs=["y"], fs=100.0)


@pytest.mark.parametrize(
    "coding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp1252"]
)
@pytest.mark.parametrize("packed", [False, True])
def test_encodings_and_gzip(tmp_path, coding, packed):
    data = ("Zeit [µs];Winkel [°]\r\n" + german(rows("{k}000;{a}\r\n"))).encode(coding)
    if coding == "utf-16-be":
        data = codecs.BOM_UTF16_BE + data
    path = tmp_path / "run.csv"
    # Two members, as `cat a.gz b.gz` makes them.
    path.write_bytes(gzip.compress(data[:1000]) + gzip.compress(data[1000:]) if packed else data)
    reader, contents = opened(path)
    assert [(c.name, c.unit) for c in contents.channels] == [("Winkel", "deg")]
    (series,) = reader.read(path, ["Winkel"], Layout())
    assert np.array_equal(series.values, K / 10)
    assert np.abs(series.time - K / 1000).max() < 1e-15


def test_times_of_day_run_over_midnight(tmp_path):
    path = tmp_path / "run.csv"
    clock = [86_390.0 + k for k in range(20)]
    lines = [
        f"{int(s % 86_400) // 3600}:{int(s % 3600) // 60:02d}:{s % 60:04.1f},{s}" for s in clock
    ]
    path.write_text("clock,a\n" + "\n".join(lines))
    reader, contents = opened(path)
    assert contents.time == "clock"
    (series,) = reader.read(path, ["a"], Layout())
    assert np.array_equal(series.time, series.values)


def test_headerless_columns_are_numbered_and_nothing_is_guessed(tmp_path):
    path = tmp_path / "run.dat"
    path.write_text(rows("  {k} {a} {b}\n"))
    _, contents = opened(path)
    assert [c.name for c in contents.channels] == ["column 1", "column 2", "column 3"]
    with pytest.raises(FormatError, match=r"inputs=\['column 1'\] or --input"):
        read(path)
    with pytest.raises(FormatError, match="no column time or t among column 1, column 2, column 3"):
        read(path, inputs=["2"], outputs=["3"])
    record = read(path, inputs=["2"], outputs=["column 3"], time="1 [ms]")
    assert record.inputs[0].time[-1] == 0.299
    assert np.array_equal(record.outputs[0].values, -K / 4)
    assert read(path, inputs=["2"], outputs=["3"], fs=50.0).inputs[0].time[1] == 0.02


def test_empty_cells_words_for_nothing_and_codes_are_missing(tmp_path):
    path = tmp_path / "run.csv"
    cells = ["1", "", " ", "nan", "NaN", "-", "N/A", "#DIV/0!", "9.91E+37", "null", "-1.#IND", "2"]
    path.write_text("t,a\n" + "".join(f"{k},{c}\n" for k, c in enumerate(cells)))
    reader, _ = opened(path)
    (series,) = reader.read(path, ["a"], Layout())
    assert np.flatnonzero(np.isfinite(series.values)).tolist() == [0, 11]


def test_a_last_line_that_is_cut_short_is_left_out_and_said(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time,u,y\n0,1,2\n0.1,3,4\n0.2,5,6\n0.3,7")
    record = read(path)
    assert record.samples == 3
    assert [f.code for f in record.findings] == ["cut_short", "assumed_roles"]
    assert "the last line of the file (5) is cut short" in record.findings[0].message


def test_a_bomb_is_stopped_and_the_limit_said(tmp_path, monkeypatch):
    monkeypatch.setattr(source, "MAX_EXPANDED", 3_000_000)
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(gzip.compress(b"time,u,y\n" + b"0,0,0\n" * 10**6))
    assert path.stat().st_size < 20_000
    with pytest.raises(FormatError, match=r"expands to more than 0\.00279\d* GiB.*unpack it first"):
        read(path)


def test_a_line_without_end_is_no_table(tmp_path, monkeypatch):
    monkeypatch.setattr(source, "MAX_LINE", 1000)
    path = tmp_path / "a.csv"
    path.write_text("time,u,y\n0,1,2\n" + "1," * 10**4)
    with pytest.raises(FormatError, match="line 3 has more than 1000 characters"):
        read(path)
    path.write_text("time,u,y\n0,1,2\n" + "1," * 10**4 + "1\n")
    with pytest.raises(FormatError, match="line 3 has 10001 cells where 3 are needed"):
        read(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (gzip.compress(PLAIN.encode())[:-20], "cut short; copy it again"),
        (gzip.compress(PLAIN.encode())[:30] + b"x" * 500, "damaged gzip file"),
        (b"time,u,y\n0,1,2\n0.1,3,\0\n", "binary"),
        (MANY + b"0,\0,2\n", "line 100002 holds a NUL"),
        (MANY + b"0,\xff\x81,2\n", "line 100002 holds the byte 0xff"),
        (LONG + b"0,1\n0,1,2\n", "line 40002 has 2 cells where 3"),
        (MANY + b"0,x,2\n", "line 100002, column 'u' holds 'x'"),
        ("time;u;y\n0,5;1,5;2\n0,6;1.5;2\n", "'u' holds '1.5', where a decimal comma is used"),
        ("time,u,y\n0,1,2\n1,1_0,4\n2,1_1,5\n", "'u' holds '1_0', which is not a number"),
        ("a b c\nd e f\n", "holds no rows of numbers"),
        ("time,u\n0,1,2\n1,2,3\n", r"has 2 column names \(time, u\) above rows of 3 cells"),
    ],
)
def test_damage_is_said_with_its_place(tmp_path, content, words):
    path = tmp_path / "a.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FormatError, match=words):
        read(path)


def test_a_unit_that_is_none_of_time(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time [deg],u,y\n0,1,2\n1,2,3\n")
    with pytest.raises(UnitError, match=r"'a\.csv', column 'time \[deg\]': 'deg' is not a unit"):
        read(path)


def test_two_columns_of_one_name_are_told_apart_by_their_place(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,u,y,y\n0,1,2,3\n1,2,3,4\n")
    with pytest.raises(FormatError, match=r"two columns 'y'; say which: 'y \(column 3\)'"):
        read(path)
    assert read(path, outputs=["y (column 4)"]).outputs[0].values.tolist() == [3, 4]


@pytest.mark.parametrize(
    ("cut", "lost"),
    [("0.99,1.", 1), ("0.99,1.2", 1), ("0.99,1.25e", 1), ("0.99,1.25e-", 1), ("0.99,1.2500", 0)],
)
def test_a_last_number_that_is_cut_short_is_left_out(tmp_path, cut, lost):
    """1.25 of 1.2500e-05 would be a spike; without an end of line it may be all there is."""
    lines = ["t,y", *(f"{k / 100:.2f},{np.cos(k):.4f}" for k in range(99))]
    path = tmp_path / "cut.csv"
    path.write_text("\n".join([*lines, cut]))
    (series,) = reader_for(path).read(path, ["y"], Layout())
    assert series.values.size == 100 - lost
    assert [f.code for f in series.findings] == ["cut_short"] * lost
    if not lost:  # an end of line says that the row is whole
        path.write_text("\n".join([*lines, "0.99,1.2", ""]))
        assert reader_for(path).read(path, ["y"], Layout())[0].values[-1] == 1.2


@pytest.mark.parametrize(("delimiter", "mark"), [(",", "."), (";", ",")])
def test_a_typeset_minus_is_a_minus(tmp_path, delimiter, mark):
    values = np.round(np.sin(np.arange(60.0)), 3)
    lines = [f"t{delimiter}y", *(f"{k}{delimiter}{v:.3f}" for k, v in enumerate(values))]
    text = "\n".join(lines).replace("-", "\N{MINUS SIGN}").replace(".", mark)
    path = tmp_path / "typeset.csv"
    path.write_text(text + "\n", encoding="utf-8")
    (series,) = reader_for(path).read(path, ["y"], Layout())
    assert np.array_equal(series.values, values)


def test_what_is_no_table_is_shown_where_its_numbers_should_be(tmp_path):
    path = tmp_path / "fortran.csv"
    path.write_text("t,y\n" + "1.5D+00,2.5D+00\n" * 9)
    with pytest.raises(FormatError, match=r"no rows of numbers: line 6 is '1.5D\+00,2.5D\+00'"):
        read(path)


def test_a_column_of_numbers_without_a_name_is_called_by_its_place(tmp_path):
    """Not the first, which is the index of a data frame, nor one that is empty."""
    path = tmp_path / "frame.csv"
    path.write_text(",t,,y,\n" + "".join(f"{k},{k / 10},{k % 3},{k % 5},\n" for k in range(60)))
    contents = reader_for(path).channels(path, Layout())
    assert [c.name for c in contents.channels] == ["column 3", "y"]
    record = read(path, inputs=["column 3"])
    assert record.inputs[0].values[:4].tolist() == [0, 1, 2, 0]
