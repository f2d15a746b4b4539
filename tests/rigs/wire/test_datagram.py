"""Every byte of the datagrams, and what is no datagram."""

import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import RigError
from hmpim.rigs.wire import Command, Datagram, Kind, Response, State, pack, unpack


def test_a_command_byte_by_byte():
    command = Command(
        position=np.array([1.0, -2.0]), velocity=np.array([0.5, 0.0]), acceleration=np.zeros(2)
    )
    sent = pack(Datagram(kind=Kind.COMMAND, session=0x01020304, number=7, sent=-2, command=command))
    assert sent[:24] == bytes.fromhex(
        "484d5049 01 05 0002 01020304 00000007 fffffffffffffffe".replace(" ", "")
    )
    assert sent[24:] == bytes.fromhex(
        "3ff0000000000000 3fe0000000000000 0000000000000000"
        "c000000000000000 0000000000000000 0000000000000000".replace(" ", "")
    )


def test_a_response_byte_by_byte():
    response = Response(
        in_force=3,
        newest=5,
        state=State.MOVING,
        reckoned=True,
        sampled=1,
        arrived=2,
        position=np.array([1.0]),
        measured=np.array([0.5]),
    )
    sent = pack(Datagram(kind=Kind.RESPONSE, session=1, number=2, sent=3, response=response))
    assert sent[24:] == bytes.fromhex(
        "00000003 00000005 03 01 0000 0000000000000001 0000000000000002"
        "3ff0000000000000 3fe0000000000000".replace(" ", "")
    )


@given(
    values=st.lists(st.floats(width=64, allow_nan=False), min_size=3, max_size=18),
    number=st.integers(0, 2**32 - 1),
    sent=st.integers(-(2**63), 2**63 - 1),
)
def test_numbers_come_back_bit_for_bit(values, number, sent):
    n = len(values) // 3
    p, v, a = np.array(values[: 3 * n]).reshape(3, n)
    command = Command(position=p, velocity=v, acceleration=a)
    again = unpack(pack(Datagram(kind=Kind.COMMAND, number=number, sent=sent, command=command)))
    assert (again.number, again.sent) == (number, sent)
    for name in ("position", "velocity", "acceleration"):
        assert getattr(again.command, name).tobytes() == getattr(command, name).tobytes()


@given(data=st.binary(max_size=200), keep=st.integers(0, 30))
def test_whatever_comes_is_a_datagram_or_a_rig_error(data, keep):
    good = pack(Datagram(kind=Kind.HELLO, text="{}"))
    with contextlib.suppress(RigError):
        unpack(good[:keep] + data)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "0 bytes that are no datagram of hmpim"),
        (b"HMPI\x02" + bytes(19), "speaks version 2 of the protocol, this one 1"),
        (b"HMPI\x01\x63" + bytes(18), "a datagram of kind 99, which is not known"),
        (b"HMPI\x01\x05\x00\x02" + bytes(16 + 24), "a command of 24 bytes for 2 axes; it must ha"),
        (b"HMPI\x01\x06\x00\x01" + bytes(16 + 28), "a response of 28 bytes for 1 axes"),
        (
            b"HMPI\x01\x06\x00\x00" + bytes(16) + struct.pack("!IIBBHqq", 0, 0, 9, 0, 0, 0, 0),
            "a response with state 9",
        ),
    ],
)
def test_what_is_no_datagram(data, words):
    with pytest.raises(RigError, match=words):
        unpack(data)
