"""ArduPilot logs: field by field as pymavlink reads them, factors applied once and said."""

import struct

import numpy as np
import pytest

import sample_logs
from hmpim.formats import read
from hmpim.formats.readers import Layout, reader_for


def by_pymavlink(path):
    """Values by field, as pymavlink decodes each message."""
    from pymavlink.DFReader import DFReader_binary

    file = DFReader_binary(str(path), zero_time_base=True)
    found = {}
    while (message := file.recv_msg()) is not None:
        kind, form = message.get_type(), message.fmt
        if kind in ("FMT", "FMTU", "UNIT", "MULT", "PARM"):
            continue
        number = getattr(message, form.instance_field) if form.instance_field else None
        name = kind if number is None else f"{kind}[{number}]"
        for label in form.columns:
            if label not in ("TimeUS", form.instance_field):
                # pymavlink shows the log's MULT as a prefix and leaves the number as it is.
                scale = 1e-3 if form.get_unit(label) == "mV" else 1.0
                row = (1e-6 * message.TimeUS, getattr(message, label) * scale)
                found.setdefault(f"{name}.{label}", []).append(row)
    file.filehandle.close()
    return {name: np.array(rows).T for name, rows in found.items()}


@pytest.mark.parametrize("damage", ["none", "a hole", "noise", "padding"])
def test_every_field_is_as_pymavlink_reads_it(damage, tmp_path):
    path = sample_logs.make("ardupilot", tmp_path)
    data = bytearray(path.read_bytes())
    if damage == "a hole":
        del data[20_000:20_700]
    elif damage == "noise":
        data[20_000:21_000] = np.random.default_rng(1).bytes(1000)
    elif damage == "padding":
        data += bytes(400)
    path.write_bytes(data)
    theirs = by_pymavlink(path)
    reader = reader_for(path)
    assert {c.name for c in reader.channels(path, Layout()).channels} == set(theirs)
    for series in reader.read(path, list(theirs), Layout()):
        time, values = theirs[series.name]
        # Around the damage one may find a message more than the other.
        assert abs(time.size - series.time.size) <= (2 if damage in ("a hole", "noise") else 0)
        both, mine, other = np.intersect1d(np.round(1e6 * series.time), np.round(1e6 * time),
                                           return_indices=True)  # fmt: skip
        assert both.size >= 0.9 * series.time.size
        assert series.values[mine] == pytest.approx(values[other], rel=1e-12)


def test_a_factor_is_applied_once_and_shown_with_its_unit(tmp_path):
    """A type's own factor and the log's MULT for it are the same thing said twice."""
    path = sample_logs.make("ardupilot", tmp_path)
    record = read(path, inputs=["BAT.Volt"], outputs=["BAT.Lat", "IMU[0].T", "RATE.R"])
    volt, lat, warm = record.inputs[0], record.outputs[0], record.outputs[1]
    assert (volt.unit, lat.unit, warm.unit) == ("V", "deg", "degC")
    assert volt.values[0] == 16.0
    assert lat.values[0] == 47.397742
    assert warm.values[0] == 25.5
    said = [f.message for f in record.findings if f.code == "scale"]
    assert sorted(said) == [
        "counts of BAT.Lat are read as 1e-07 deg each, as the file states",
        "counts of BAT.Volt are read as 0.001 V each, as the file states",
        "counts of IMU[0].T are read as 0.01 degC each, as the file states",
    ]


def test_a_message_described_again_keeps_both(tmp_path):
    path = sample_logs.make("ardupilot", tmp_path)
    again = sample_logs._bin_format(0x90, "RATE", "Qf", "TimeUS,R")
    more = b"".join(
        b"\xa3\x95\x90" + struct.pack("<Qf", 20_000_000 + 5000 * k, float(k)) for k in range(50)
    )
    path.write_bytes(path.read_bytes() + again + more)
    reader = reader_for(path)
    first, second = reader.read(path, ["RATE.R", "RATE'.R"], Layout())
    assert first.values.size == sample_logs.N
    assert second.values.tolist() == list(range(50))
