"""Datagrams over bytes and short frames: whole or not at all, whatever the line does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.rigs.wire.framing import Deframer, Reassembly, can_frames, serial_frame
from tests_support import examples

DATAGRAMS = st.lists(
    st.one_of(st.binary(min_size=1, max_size=600), st.builds(bytes, st.integers(1, 600))),
    min_size=1, max_size=5,
)  # fmt: skip


@given(datagrams=DATAGRAMS, cuts=st.lists(st.integers(1, 50), min_size=1))
@examples(60)
def test_a_serial_line_gives_back_what_went_in_however_it_is_cut(datagrams, cuts):
    line = b"".join(serial_frame(data) for data in datagrams)
    deframer, found, at, k = Deframer(), [], 0, 0
    while at < len(line):
        found += deframer.take(line[at : at + cuts[k % len(cuts)]])
        at, k = at + cuts[k % len(cuts)], k + 1
    assert found == datagrams


@given(data=st.binary(min_size=1, max_size=892))
@examples(60)
def test_a_bus_gives_back_what_went_in(data):
    whole = Reassembly()
    frames = list(can_frames(data))
    assert all(2 <= len(frame) <= 8 for frame in frames)
    assert [whole.take(frame) for frame in frames] == [None] * (len(frames) - 1) + [data]


def test_damaged_bytes_lose_datagrams_and_never_make_any():
    rng = np.random.default_rng(0)
    sent = [rng.bytes(int(n)) for n in rng.integers(20, 150, 300)]
    line = bytearray(b"".join(serial_frame(data) for data in sent))
    for place in rng.integers(0, len(line), 60):
        line[place] ^= int(rng.integers(1, 256))
    found = Deframer().take(bytes(line))
    assert set(found) <= set(sent)
    assert 150 < len(found) < 300


def test_lost_and_doubled_frames_lose_datagrams_and_never_make_any():
    rng = np.random.default_rng(0)
    sent = [rng.bytes(int(n)) for n in rng.integers(20, 150, 300)]
    frames = [frame for data in sent for frame in can_frames(data)]
    bus = [f for f in frames for _ in range(int(rng.choice(3, p=[0.01, 0.98, 0.01])))]
    whole = Reassembly()
    found = [data for data in map(whole.take, bus) if data is not None]
    assert set(found) <= set(sent)
    assert 150 < len(found) < 300


def test_too_long_for_can():
    with pytest.raises(ValueError, match="893 bytes are too long for CAN; at most 892 fit"):
        list(can_frames(bytes(893)))
