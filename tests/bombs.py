"""Small files of each packed format that unpack to far more, made without unpacking them.

A piece of zeros is packed once and stands in the file as often as it must.
"""

import bz2
import contextlib
import re
import struct
import zlib

import numpy as np

SIZE = 5 * 2**27
"""Bytes that each unpacks to."""

_PIECE = 2**26


def hdf5(path):
    """Chunks of zeros under deflate."""
    import h5py

    chunk = _PIECE // 8
    packed = zlib.compress(bytes(_PIECE), 9)
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(10.0)
        data = file.create_dataset(
            "u", shape=(SIZE // 8,), chunks=(chunk,), dtype="f8", compression="gzip"
        )
        for k in range(SIZE // _PIECE):
            data.id.write_direct_chunk((k * chunk,), packed)


def hdf5_chunk(path):
    """A chunk that states 8 kB and unpacks to gigabytes."""
    import h5py

    with h5py.File(path, "w") as file:
        file["t"] = np.arange(1024.0)
        data = file.create_dataset(
            "u", shape=(1024,), chunks=(1024,), dtype="f8", compression="gzip"
        )
        data.id.write_direct_chunk((0,), zeros_deflated(b"", SIZE))


def hdf5_promised(path):
    """A table of which no sample is stored, and which is promised to hold 10^13."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("u", shape=(10**13,), chunks=(2**20,), dtype="f8")


def zeros_deflated(head, size):
    """`head` and `size` zeros as one zlib stream, packed piece by piece."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    start = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    piece = packer.compress(bytes(_PIECE)) + packer.flush(zlib.Z_FULL_FLUSH)
    end = packer.flush(zlib.Z_FINISH)
    check = zlib.adler32(head)
    low, high = check & 0xFFFF, check >> 16
    high = (high + low * size) % 65521
    return b"\x78\xda" + start + piece * (size // _PIECE) + end + struct.pack(">HH", high, low)


def mat5(path):
    """One compressed matrix of zeros."""
    count = SIZE // 8
    flags = struct.pack("<IIII", 6, 8, 6, 0)  # a full matrix of doubles
    shape = struct.pack("<IIii", 5, 8, count, 1)
    name = struct.pack("<HH4s", 1, 1, b"u")
    inside = flags + shape + name + struct.pack("<II", 9, SIZE)
    packed = zeros_deflated(struct.pack("<II", 14, len(inside) + SIZE) + inside, SIZE)
    head = b"MATLAB 5.0 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<H2s", 0x100, b"IM")
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def mdf(path):
    """A zipped block of a record that is made by asammdf, blown up."""
    import asammdf

    t = np.arange(4000) / 100.0
    log = asammdf.MDF(version="4.10")
    log.append([asammdf.Signal(np.zeros(t.size), t, name="u"), asammdf.Signal(t, t, name="y")])
    made = path.with_suffix(".mf4")
    log.save(made, overwrite=True, compression=1)
    log.close()
    data = made.read_bytes()
    made.unlink()
    old = data.index(b"##DZ")
    links, lead = data[old : old + 24], 24  # id, reserved, length, number of links
    kind = data[old + lead : old + lead + 8]  # what it holds, how it is packed, parameter
    packed = zeros_deflated(b"", SIZE)
    block = links[:8] + struct.pack("<QQ", 48 + len(packed), 0) + kind
    block += struct.pack("<QQ", SIZE, len(packed)) + packed
    data += bytes(-len(data) % 8)
    moved = data.replace(struct.pack("<Q", old), struct.pack("<Q", len(data)))
    assert moved != data
    path.write_bytes(moved + block)


def parquet(path):
    """One packed group of rows, listed in the footer as often as it takes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = _PIECE // 8
    one = path.with_suffix(".one")
    pq.write_table(pa.table({"t": np.zeros(rows), "u": np.zeros(rows)}), one, compression="zstd")
    about = pq.read_metadata(one)
    again = pq.read_metadata(one)
    for _ in range(SIZE // _PIECE - 1):
        about.append_row_groups(again)
    foot = path.with_suffix(".foot")
    about.write_metadata_file(foot)
    data, end = one.read_bytes(), foot.read_bytes()
    length = struct.unpack("<I", data[-8:-4])[0]
    path.write_bytes(data[: -8 - length] + end[4:])
    one.unlink()
    foot.unlink()


def _zstd():
    from backports import zstd

    return zstd.compress(bytes(_PIECE)) * (SIZE // _PIECE)


def _lz4(head=b""):
    """One frame: `head`, then blocks of zeros that are one another's copies."""
    import lz4.frame

    packer = lz4.frame.LZ4FrameCompressor(
        block_size=lz4.frame.BLOCKSIZE_MAX4MB, block_linked=False, auto_flush=True
    )
    start = packer.begin() + packer.compress(head)
    return start + packer.compress(bytes(_PIECE)) * (SIZE // _PIECE) + packer.flush()


def mcap(path, packing="zstd"):
    """A chunk of zeros, in a log without an index."""
    packed = {"zstd": _zstd, "lz4": _lz4}[packing]()
    name = packing.encode()
    body = struct.pack("<QQQI", 0, 1, SIZE, 0) + struct.pack("<I", len(name)) + name
    body += struct.pack("<Q", len(packed)) + packed
    head = struct.pack("<I4sI", 4, b"ros2", 0)
    records = ((0x01, head), (0x06, body), (0x0F, bytes(4)), (0x02, bytes(20)))
    inside = b"".join(struct.pack("<BQ", op, len(data)) + data for op, data in records)
    path.write_bytes(b"\x89MCAP0\r\n" + inside + b"\x89MCAP0\r\n")


def mcap_lz4(path):
    mcap(path, "lz4")


def rosbag1(path, packing="bz2"):
    """A bag of ROS 1 whose chunk has zeros behind its messages."""
    import sample_logs

    sample_logs.ros1(path, packing, {"bz2": _bz2, "lz4": _lz4}[packing])


def _bz2(head):
    return bz2.compress(head) + bz2.compress(bytes(_PIECE)) * (SIZE // _PIECE)


def rosbag1_lz4(path):
    rosbag1(path, "lz4")


def rosbag2_messages(path):
    """A bag of ROS 2 whose messages are packed one by one, one of them blown up."""
    _rosbag2(path, "message", lambda raw: _zstd())


def rosbag2_file(path):
    """A bag of ROS 2 whose file is packed as a whole: it is unpacked to a temporary file."""
    _rosbag2(path, "file", lambda raw: raw)
    (file,) = path.glob("*.mcap")
    file.with_name(f"{file.name}.zstd").write_bytes(_zstd())
    about = path / "metadata.yaml"
    about.write_text(about.read_text().replace(file.name, f"{file.name}.zstd"))
    file.unlink()


def _rosbag2(path, mode, pack):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    point = store.types["geometry_msgs/msg/Vector3"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/cmd", point.__msgtype__, typestore=store)
        raw = store.serialize_cdr(point(x=1.0, y=0.0, z=0.0), point.__msgtype__)
        writer.write(topic, 10**9, pack(bytes(raw)))
    about = path / "metadata.yaml"
    text = re.sub(r"compression_format:.*", "compression_format: zstd", about.read_text())
    about.write_text(re.sub(r"compression_mode:.*", f"compression_mode: {mode}", text))


def sqlite_view(path):
    """A bag whose messages are no table but a view that makes rows without end."""
    import sqlite3

    import sample_logs

    sample_logs.db3(path)
    with contextlib.closing(sqlite3.connect(path)) as file, file:
        file.execute("ALTER TABLE messages RENAME TO kept")
        file.execute(
            "CREATE VIEW messages AS WITH RECURSIVE more(id) AS "
            "(SELECT 1 UNION ALL SELECT id + 1 FROM more) SELECT more.id, kept.topic_id, "
            "kept.timestamp, kept.data FROM more JOIN kept ON kept.id = 1"
        )


KINDS = {
    "hdf5": hdf5,
    "hdf5-chunk": hdf5_chunk,
    "hdf5-promised": hdf5_promised,
    "mat5": mat5,
    "mdf": mdf,
    "parquet": parquet,
    "mcap-zstd": mcap,
    "mcap-lz4": mcap_lz4,
    "rosbag1-bz2": rosbag1,
    "rosbag1-lz4": rosbag1_lz4,
    "rosbag2-messages": rosbag2_messages,
    "rosbag2-file": rosbag2_file,
    "sqlite-view": sqlite_view,
}
"""What makes a bomb of each kind."""
