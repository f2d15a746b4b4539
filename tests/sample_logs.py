"""A log of each format, made by the format's own library or by its printed layout.

Each holds `u` and `y`, which follows it by `DELAY`: sums of sines, so that the delay can be told
from phases alone, whatever the clocks are.
"""

import gc
import json
import struct
import warnings
from pathlib import Path

import numpy as np

FS = 200.0
N = 800
DELAY = 0.0371
LINES = (1.0, 2.25, 5.5, 9.75)
TIME = np.arange(N) / FS


def drive(t):
    return sum(np.sin(2 * np.pi * f * t + k) for k, f in enumerate(LINES)) / len(LINES)


U, Y = drive(TIME), drive(TIME - DELAY)


def delay_between(first, second, lines=LINES):
    """Delay in s that the phases of two channels show, each on its own clock."""
    phases = []
    for channel in (first, second):
        rows = [f(2 * np.pi * line * channel.time) for line in lines for f in (np.cos, np.sin)]
        found = np.linalg.lstsq(
            np.stack([*rows, np.ones_like(channel.time)], axis=1), channel.values, rcond=None
        )[0]
        phases.append(np.arctan2(found[0:-1:2], found[1:-1:2]))
    shift = np.angle(np.exp(1j * (phases[0] - phases[1])))
    omega = 2 * np.pi * np.array(lines)
    return float(omega @ shift / (omega @ omega))


def parquet(path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table({"time [ms]": 1000 * TIME, "u [V]": U, "y": Y, "note": ["x"] * N})
    pq.write_table(table, path)


def lerobot(path, episodes=((U, Y),), fs=FS):
    """One file of several episodes, each with time from 0, as LeRobot 3 writes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    sizes = [u.size for u, _ in episodes]
    u, y = (np.concatenate([episode[k] for episode in episodes]) for k in (0, 1))
    action = np.stack([u, 2 * u], axis=1).astype(np.float32)
    state = np.stack([y, 2 * y], axis=1).astype(np.float32)
    frames = np.concatenate([np.arange(size) for size in sizes])
    columns = {
        "action": pa.array(list(action), pa.list_(pa.float32(), 2)),
        "observation.state": pa.array(list(state), pa.list_(pa.float32())),
        "timestamp": pa.array((frames / fs).astype(np.float32)),
        "frame_index": pa.array(frames),
        "episode_index": pa.array(np.repeat(np.arange(len(sizes)), sizes)),
    }
    pq.write_table(pa.table(columns), path)
    names = {"names": {"motors": ["pan", "lift"]}, "shape": [2]}
    meta = path.parent / "meta"
    meta.mkdir(exist_ok=True)
    info = {"fps": fs, "features": {"action": names, "observation.state": names}}
    (meta / "info.json").write_text(json.dumps(info))


def mat5(path):
    from scipy.io import savemat

    log = {"time": TIME[:, None], "u": U[:, None], "sensors": {"gyro": np.stack([Y, -Y], axis=1)}}
    with path.open("wb") as file:
        savemat(file, {"log": log, "K": 3.0, "note": "bench 2"})


def mat73(path):
    """As MATLAB lays it out: HDF5 behind 512 bytes of its own, matrices turned."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t", TIME), ("u", U), ("y", Y)):
            dataset = file.create_dataset(name, data=values[None, :])
            dataset.attrs["MATLAB_class"] = np.bytes_("double")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Sat Nov 21 12:00:00 2026"
    with path.open("r+b") as file:
        file.write(head.ljust(124) + struct.pack("<H", 0x0200) + b"IM")


def hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        run = file.create_group("run 1")
        run.create_dataset("t", data=TIME)
        run.create_dataset("u", data=U, compression="gzip").attrs["units"] = "V"
        run.create_dataset("imu", data=np.stack([Y, -Y], axis=1)).attrs["units"] = "deg/s"


def mdf(path):
    import asammdf

    log = asammdf.MDF(version="4.10")
    log.append([asammdf.Signal(U, TIME, name="u", unit="V")], acq_name="drive")
    late = TIME + 0.0007  # a group of its own clock
    values = drive(late - DELAY)
    log.append([asammdf.Signal(values, late, name="y", unit="deg/s")], acq_name="gyro")
    log.save(path.with_suffix(".mf4"), overwrite=True, compression=2)
    path.with_suffix(".mf4").rename(path)


def tdms(path):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        for part in (slice(0, N // 2), slice(N // 2, N)):
            about = {"wf_increment": 1 / FS, "wf_start_offset": 0.0, "unit_string": "V"}
            late = {**about, "wf_start_offset": 0.0007}
            writer.write_segment(
                [
                    ChannelObject("rig", "u", U[part], properties=about),
                    ChannelObject("rig", "y", drive(TIME[part] + 0.0007 - DELAY), properties=late),
                ]
            )


def _ulog_message(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog(path, drive_and_answer=(U, Y), fs=FS):
    """By https://docs.px4.io/main/en/dev_log/ulog_file_format.html."""
    head = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)
    forms = (
        b"vehicle_rates_setpoint:uint64_t timestamp;float roll;uint8_t[4] _padding0;",
        b"vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;"
        b"uint8_t[4] _padding0;",
    )
    out = [head, _ulog_message("B", bytes(40))]
    out += [_ulog_message("F", form) for form in forms]
    info = b"char[3] sys_name" + b"PX4"
    out.append(_ulog_message("I", bytes([16]) + info))
    out.append(_ulog_message("A", struct.pack("<BH", 0, 0) + b"vehicle_rates_setpoint"))
    out.append(_ulog_message("A", struct.pack("<BH", 0, 1) + b"vehicle_angular_velocity"))
    for k, (u, y) in enumerate(zip(*drive_and_answer, strict=True)):
        stamp = 1_000_000 + round(1e6 * k / fs)
        out.append(_ulog_message("D", struct.pack("<HQf", 0, stamp, u)))
        # Measured, and published 1.5 ms later.
        row = struct.pack("<HQQ3f", 1, stamp + 1500, stamp, y, 0.0, 1.0)
        out.append(_ulog_message("D", row))
        if k == N // 2:
            out.append(_ulog_message("O", struct.pack("<H", 12)))
    path.write_bytes(b"".join(out))


def _bin_format(kind, name, form, columns):
    size = 3 + struct.calcsize("<" + "".join(_BIN[c] for c in form))
    body = struct.pack("<BB4s16s64s", kind, size, name.encode(), form.encode(), columns.encode())
    return b"\xa3\x95\x80" + body


_BIN = {
    "Q": "Q",
    "f": "f",
    "B": "B",
    "c": "h",
    "N": "16s",
    "Z": "64s",
    "n": "4s",
    "b": "b",
    "d": "d",
    "H": "H",
    "L": "l",
}


def ardupilot(path):
    """By https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html."""
    out = [
        _bin_format(0x80, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        _bin_format(0x81, "UNIT", "QbZ", "TimeUS,Id,Label"),
        _bin_format(0x82, "MULT", "Qbd", "TimeUS,Id,Mult"),
        _bin_format(0x83, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        _bin_format(0x90, "RATE", "Qff", "TimeUS,RDes,R"),
        _bin_format(0x91, "IMU", "QBfc", "TimeUS,I,GyrX,T"),
        _bin_format(0x92, "BAT", "QHL", "TimeUS,Volt,Lat"),
    ]
    units = {"s": "s", "k": "deg/s", "E": "rad/s", "#": "instance", "O": "degC", "v": "V"}
    for letter, label in {**units, "D": "deglatitude"}.items():
        out.append(b"\xa3\x95\x81" + struct.pack("<Qb64s", 0, ord(letter), label.encode()))
    for letter, factor in {"-": 0.0, "F": 1e-6, "C": 1e-3, "B": 1e-2, "G": 1e-7}.items():
        out.append(b"\xa3\x95\x82" + struct.pack("<Qbd", 0, ord(letter), factor))
    stated = ((0x90, b"skk", b"F--"), (0x91, b"s#EO", b"F--B"), (0x92, b"svD", b"FCG"))
    for kind, letters, factors in stated:
        out.append(b"\xa3\x95\x83" + struct.pack("<QB16s16s", 0, kind, letters, factors))
    for k, t in enumerate(TIME):
        stamp = 5_000_000 + round(1e6 * t)
        out.append(b"\xa3\x95\x90" + struct.pack("<Qff", stamp, U[k], Y[k]))
        for number in (0, 1):
            row = struct.pack("<QBfh", stamp + number, number, Y[k] * (1 + number), 2550)
            out.append(b"\xa3\x95\x91" + row)
        if k % 20 == 0:
            row = struct.pack("<QHl", stamp, 16_000 - k, 473_977_420 + k)
            out.append(b"\xa3\x95\x92" + row)
    path.write_bytes(b"".join(out))


def _signed_vb(value):
    return _unsigned_vb(((value << 1) ^ (value >> 31)) & 0xFFFFFFFF)


def _unsigned_vb(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes(out) + bytes([value])


def blackbox(path, flights=1, drive_and_answer=(U, Y), fs=FS):
    """By https://betaflight.com/docs/development/Blackbox-Internals."""
    head = (
        b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n"
        b"H Data version:2\n"
        b"H I interval:32\n"
        b"H P interval:1/1\n"
        b"H Field I name:loopIteration,time,setpoint[0],gyroADC[0]\n"
        b"H Field I signed:0,0,1,1\n"
        b"H Field I predictor:0,0,0,0\n"
        b"H Field I encoding:1,1,0,0\n"
        b"H Field P predictor:6,2,1,1\n"
        b"H Field P encoding:9,0,0,0\n"
        b"H Firmware type:Cleanflight\n"
        b"H Firmware revision:Betaflight 4.5.1 (77d01ba3b) STM32F7X2\n"
        b"H gyro_scale:0x3f000000\n"  # 0.5
    )
    # 1000 deg/s at most; the log counts half degrees/s of the gyro.
    setpoint = np.rint(1000 * drive_and_answer[0]).astype(int).tolist()
    gyro = np.rint(2000 * drive_and_answer[1]).astype(int).tolist()
    stamps = np.rint(1e6 * np.arange(len(gyro)) / fs).astype(int) + 7_000_000
    flight = bytearray(head)
    for k, stamp in enumerate(stamps.tolist()):
        if k % 32 == 0:
            flight += b"I" + _unsigned_vb(k) + _unsigned_vb(stamp)
            flight += _signed_vb(setpoint[k]) + _signed_vb(gyro[k])
            before = [stamp, stamp]
        else:
            flight += b"P" + _signed_vb(stamp - (2 * before[0] - before[1]))
            flight += _signed_vb(setpoint[k] - setpoint[k - 1]) + _signed_vb(gyro[k] - gyro[k - 1])
            before = [stamp, before[0]]
    flight += b"E\xffEnd of log\0"
    path.write_bytes(bytes(flight) * flights)


def ros(path, storage="mcap", drive_and_answer=(U, Y), fs=FS, transport=0.004, stamped=True):
    """A bag: a command and the sensor's answer, stamped, logged later by the transport.

    Without `stamped` the command has only the log's stamp.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    vector, header, stamp_of = (
        store.types[f"{name}"]
        for name in (
            "geometry_msgs/msg/Vector3Stamped",
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
        )
    )
    joints = store.types["sensor_msgs/msg/JointState"]
    point = store.types["geometry_msgs/msg/Vector3"]
    plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        kind = (vector if stamped else point).__msgtype__
        command = writer.add_connection("/cmd", kind, typestore=store)
        state = writer.add_connection("/joint_states", joints.__msgtype__, typestore=store)
        start = 1_763_726_400 * 10**9
        for k in range(len(drive_and_answer[0])):
            ticks = start + round(1e9 * k / fs)
            stamp = stamp_of(sec=ticks // 10**9, nanosec=ticks % 10**9)
            u = float(drive_and_answer[0][k])
            message = point(x=u, y=0.0, z=0.0)
            if stamped:
                message = vector(header=header(stamp=stamp, frame_id=""), vector=message)
            writer.write(command, ticks, store.serialize_cdr(message, message.__msgtype__))
            answer = joints(
                header=header(stamp=stamp, frame_id=""),
                name=["pan", "tilt"],
                position=np.array([drive_and_answer[1][k], 0.0]),
                velocity=np.zeros(0),
                effort=np.zeros(0),
            )
            late = ticks + round(1e9 * transport)
            writer.write(state, late, store.serialize_cdr(answer, joints.__msgtype__))


def ros1(path, packing="lz4", packer=None):
    """A bag of ROS 1, packed, whose sensor is logged later by the transport.

    `packer` packs a chunk instead of the library.
    """
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    names = ("geometry_msgs/msg/Vector3Stamped", "sensor_msgs/msg/Imu", "std_msgs/msg/Header")
    vector, imu, header = (store.types[name] for name in names)
    stamp_of = store.types["builtin_interfaces/msg/Time"]
    point = store.types["geometry_msgs/msg/Vector3"]
    turn = store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    writer = Writer(path.with_suffix(".bag"))
    writer.set_compression(Writer.CompressionFormat[packing.upper()])
    if packer is not None:
        writer.compressor = packer
    still, unknown = point(x=0.0, y=0.0, z=0.0), np.zeros(9)
    with writer:
        command = writer.add_connection("/cmd", vector.__msgtype__, typestore=store)
        sensor = writer.add_connection("/imu", imu.__msgtype__, typestore=store)
        for k, (u, y) in enumerate(zip(U, Y, strict=True)):
            ticks = 1_763_726_400 * 10**9 + round(1e9 * k / FS)
            stamp = stamp_of(sec=ticks // 10**9, nanosec=ticks % 10**9)
            head = header(seq=k, stamp=stamp, frame_id="")
            message = vector(header=head, vector=point(x=float(u), y=0.0, z=0.0))
            writer.write(command, ticks, store.serialize_ros1(message, vector.__msgtype__))
            answer = imu(
                header=head,
                orientation=turn,
                orientation_covariance=unknown,
                angular_velocity=point(x=0.0, y=0.0, z=float(y)),
                angular_velocity_covariance=unknown,
                linear_acceleration=still,
                linear_acceleration_covariance=unknown,
            )
            raw = store.serialize_ros1(answer, imu.__msgtype__)
            writer.write(sensor, ticks + 4_000_000, raw)
    path.with_suffix(".bag").rename(path)


def mcap(path):
    folder = path.parent / f"{path.stem}-bag"
    ros(folder)
    (file,) = folder.glob("*.mcap")
    file.rename(path)


def db3(path):
    folder = path.parent / f"{path.stem}-bag"
    ros(folder, storage="sqlite3")
    (file,) = folder.glob("*.db3")
    file.rename(path)


def _wpilog_record(number, stamp, payload):
    sizes = [max(1, (v.bit_length() + 7) // 8) for v in (number, len(payload), stamp)]
    bits = (sizes[0] - 1) | (sizes[1] - 1) << 2 | (sizes[2] - 1) << 4
    values = (number, len(payload), stamp)
    head = b"".join(v.to_bytes(s, "little") for v, s in zip(values, sizes, strict=True))
    return bytes([bits]) + head + payload


def _wpilog_start(number, name, kind, metadata=""):
    words = b"".join(struct.pack("<I", len(w)) + w.encode() for w in (name, kind, metadata))
    return _wpilog_record(0, 0, b"\0" + struct.pack("<I", number) + words)


def wpilog(path):
    """By https://github.com/wpilibsuite/allwpilib/blob/main/wpiutil/doc/datalog.adoc."""
    out = [b"WPILOG" + struct.pack("<HI", 0x0100, 4) + b"test"]
    out.append(_wpilog_start(1, "/drive/voltage", "double", '{"unit": "V"}'))
    out.append(_wpilog_start(2, "/gyro", "float[]"))
    out.append(_wpilog_start(3, "sysid-test-state", "string"))
    out.append(_wpilog_start(300, "/ended", "int64"))
    out.append(_wpilog_record(3, 1, b"quasistatic-forward"))
    for k, t in enumerate(TIME):
        stamp = 3_000_000 + round(1e6 * t)
        out.append(_wpilog_record(1, stamp, struct.pack("<d", U[k])))
        late = stamp + 700
        answer = drive(t + 0.0007 - DELAY)
        out.append(_wpilog_record(2, late, struct.pack("<2f", answer, -answer)))
        out.append(_wpilog_record(300, late, struct.pack("<q", k)))
    out.append(_wpilog_record(0, 9_000_000, b"\x01" + struct.pack("<I", 300)))
    path.write_bytes(b"".join(out))


def klipper(path):
    """As Klipper's ``TEST_RESONANCES OUTPUT=raw_data`` writes."""
    rows = "".join(
        f"{100 + t:.6f},{a:.6f},{b:.6f},0.000000\n" for t, a, b in zip(TIME, U, Y, strict=True)
    )
    path.write_text("#time,accel_x,accel_y,accel_z\n" + rows)


def wav(path):
    from scipy.io import wavfile

    counts = np.rint(30_000 * np.stack([U, Y], axis=1)).astype(np.int16)
    wavfile.write(path, int(FS), counts)


def uff58(path, binary=1):
    import pyuff

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves files open
        _write_uff58(pyuff.UFF(str(path)), binary)
        gc.collect()


def _write_uff58(file, binary):
    for name, values, unit in (("drive", U, "V"), ("gyro", Y, "rad/s")):
        file.write_sets(
            {
                "type": 58,
                "binary": binary,
                "func_type": 1,
                "id1": name,
                "rsp_node": 1,
                "rsp_dir": 3,
                "ref_node": 0,
                "ref_dir": 0,
                "data": values,
                "x": TIME,
                "orddenom_spec_data_type": 0,
                "abscissa_axis_units_lab": "s",
                "ordinate_axis_units_lab": unit,
                "abscissa_spacing": 1,
            },
            "add",
        )


def uff58_text(path):
    uff58(path, binary=0)


def oscilloscope(path, drive_and_answer=(U, Y), fs=FS):
    """As a Tektronix scope saves two channels: lines of settings, then the samples."""
    head = (
        f"Model,MDO3024\nFirmware Version,1.26\n\nWaveform Type,ANALOG,,\nPoint Format,Y,,\n"
        f"Horizontal Units,s,,\nHorizontal Scale,1,,\nSample Interval,{1 / fs:g},,\n"
        f"Vertical Units,V,V,\n\nLabel,drive,current,\nTIME,CH1,CH2,\n"
    )
    rows = "".join(
        f"{k / fs - 1:.6e},{u:.4e},{y:.4e},\n"
        for k, (u, y) in enumerate(zip(*drive_and_answer, strict=True))
    )
    path.write_text(head + rows)


KINDS = {
    "parquet": (parquet, "u", "y"),
    "lerobot": (lerobot, "action[pan]", "observation.state[pan]"),
    "mat5": (mat5, "log.u", "log.sensors.gyro(:,1)"),
    "mat73": (mat73, "u", "y"),
    "hdf5": (hdf5, "/run 1/u", "/run 1/imu[0]"),
    "mdf": (mdf, "u", "y"),
    "tdms": (tdms, "rig/u", "rig/y"),
    "ulog": (ulog, "vehicle_rates_setpoint.roll", "vehicle_angular_velocity.xyz[0]"),
    "ardupilot": (ardupilot, "RATE.RDes", "IMU[0].GyrX"),
    "blackbox": (blackbox, "setpoint[0]", "gyroADC[0]"),
    "mcap": (mcap, "/cmd.vector.x", "/joint_states.position[pan]"),
    "db3": (db3, "/cmd.vector.x", "/joint_states.position[pan]"),
    "rosbag": (ros, "/cmd.vector.x", "/joint_states.position[pan]"),
    "ros1": (ros1, "/cmd.vector.x", "/imu.angular_velocity.z"),
    "wpilog": (wpilog, "/drive/voltage", "/gyro[0]"),
    "klipper": (klipper, "accel_x", "accel_y"),
    "wav": (wav, "1", "2"),
    "uff58": (uff58, "drive", "gyro"),
    "uff58-text": (uff58_text, "drive", "gyro"),
}
"""What makes a file of each kind, and what its input and its output are called."""


def make(kind, folder):
    """Make a file of a kind, whose name says nothing of it."""
    path = Path(folder) / f"{kind}.log"
    KINDS[kind][0](path)
    return path
