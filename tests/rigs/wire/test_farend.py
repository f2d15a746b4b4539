"""The far end alone: what it follows, refuses, reckons, and how it comes to rest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import RigError
from hmpim.rigs.wire import (
    Command,
    Datagram,
    FarEnd,
    Hello,
    Kind,
    State,
    pack,
    unpack,
)
from tests_support import examples
from wire_support import LIMITS, hello

RATE = 500.0
T = 1.0 / RATE


def said(kind, *, session=9, number=0, text="", command=None):
    return pack(Datagram(kind=kind, session=session, number=number, text=text, command=command))


def command(p, v=0.0, a=0.0):
    """Of roll; yaw stays."""
    return Command(
        position=np.array([p, 0.0]), velocity=np.array([v, 0.0]), acceleration=np.array([a, 0.0])
    )


def armed(**kwargs):
    far = FarEnd(hello(rate=RATE), **kwargs)
    (answer,) = far.receive(said(Kind.HELLO, text=Hello().to_json()), now=1)
    assert unpack(answer).kind is Kind.WELCOME
    far.receive(said(Kind.ARM), now=2)
    far.tick()
    assert far.state is State.ARMED
    return far


def cosine(amplitude, frequency, t):
    """From rest: amplitude (1 - cos)/2."""
    w = 2 * np.pi * frequency
    return command(
        0.5 * amplitude * (1 - np.cos(w * t)),
        0.5 * amplitude * w * np.sin(w * t),
        0.5 * amplitude * w * w * np.cos(w * t),
    )


def follow(far, count, *, amplitude=10.0, frequency=2.0, skip=(), first=0):
    """Send commands one a tick, some not; return orders of roll, shape (count,)."""
    orders = []
    for n in range(first, first + count):
        if n not in skip:
            far.receive(
                said(Kind.COMMAND, number=n, command=cosine(amplitude, frequency, n * T)), now=n
            )
        orders.append(far.tick())
    return orders


def test_commands_are_followed_in_turn_two_ticks_later():
    far = armed()
    orders = follow(far, 50)
    sent = [cosine(10.0, 2.0, n * T).position[0] for n in range(50)]
    assert [o.position[0] for o in orders[:2]] == [0.0, 0.0]
    assert [o.position[0] for o in orders[2:]] == sent[:48]
    assert far.state is State.MOVING
    assert far.counts.clean
    assert far.reckoned == 0


@pytest.mark.parametrize("order", [(1, 0), (2, 1, 0)])
def test_swapped_commands_are_put_in_their_place(order):
    far = armed()
    orders = []
    pending = {}
    for n in range(60):
        # Every group of commands comes in another order, within the two ticks that are waited.
        pending[n] = cosine(10.0, 2.0, n * T)
        if len(pending) == len(order):
            for k in order:
                m = sorted(pending)[k]
                far.receive(said(Kind.COMMAND, number=m, command=pending[m]), now=n)
            pending = {}
        orders.append(far.tick().position[0])
    moved = [x for x in orders if x > 0]
    sent = [cosine(10.0, 2.0, n * T).position[0] for n in range(1, 60)]
    assert np.allclose(moved, sent[: len(moved)], atol=1e-12)
    assert far.counts.swapped > 0
    assert far.reckoned == far.late == 0


def test_a_lost_command_is_reckoned_and_counted():
    far, sound = armed(), armed()
    lost = {20, 21, 40}
    orders, whole = follow(far, 80, skip=lost), follow(sound, 80)
    gap = np.array([a.position[0] - b.position[0] for a, b in zip(orders, whole, strict=True)])
    assert far.reckoned == len(lost)
    assert far.counts.lost == len(lost)
    assert np.count_nonzero(gap) == len(lost)
    # With the acceleration of the last one: third derivative times T³/6, for two in a row 8 times.
    jerk = 0.5 * 10.0 * (2 * np.pi * 2.0) ** 3
    assert np.abs(gap).max() < 1.5 * jerk * (2 * T) ** 3 / 2


@examples(12)
@given(
    stop_at=st.integers(3, 480),
    frequency=st.floats(0.3, 2.0),
    amplitude=st.floats(1.0, 59.9),
    silent=st.booleans(),
)
def test_it_comes_to_rest_inside_its_limits_from_any_instant(stop_at, frequency, amplitude, silent):
    """Yaw, near its limits: 180 deg/s needs 0.18 s and 16.2 deg to stand."""
    w, limits = 2 * np.pi * frequency, LIMITS["yaw"]
    amplitude = min(amplitude, 1.99 * limits.velocity / w, 1.99 * limits.acceleration / w**2)
    far = armed()
    orders = []
    for n in range(stop_at + 700):
        if n < stop_at:
            x = cosine(amplitude, frequency, n * T)
            yaw = Command(
                position=x.position[::-1],
                velocity=x.velocity[::-1],
                acceleration=x.acceleration[::-1],
            )
            far.receive(said(Kind.COMMAND, number=n, command=yaw), now=n)
        elif n == stop_at:
            assert far.state is State.MOVING
            if not silent:
                far.receive(said(Kind.STOP), now=n)
        orders.append(far.tick())
    position = np.array([o.position[1] for o in orders])
    velocity = np.array([o.velocity[1] for o in orders])
    assert np.abs(position).max() <= limits.position * (1 + 1e-9)
    assert velocity[-1] == 0.0
    assert np.ptp(position[-100:]) == 0.0
    assert np.abs(np.diff(velocity)).max() / T <= limits.acceleration * (1 + 1e-6)
    assert far.state in (State.AT_REST, State.FAULT)


def test_silence_begins_the_brake_within_the_watchdog_and_not_before():
    far = armed()
    follow(far, 100, amplitude=10.0, frequency=1.0)
    ticks = 0
    while far.state is State.MOVING:
        far.tick()
        ticks += 1
    assert 0.08 - 3 * T <= ticks * T <= 0.08 + 3 * T
    while far.state is State.BRAKING:
        far.tick()
    assert far.state is State.FAULT
    assert far.fault == "no command came"
    assert unpack(far.pending()[0]).text == "no command came"


def test_silence_at_rest_is_no_fault():
    far = armed()
    for n in range(10):
        far.receive(said(Kind.COMMAND, number=n, command=command(0.0)), now=n)
        far.tick()
    for _ in range(100):
        far.tick()
    assert far.state is State.AT_REST
    assert far.fault == ""


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (command(20.1), "position 20.1 commanded of roll is beyond 20 deg"),
        (command(0.5, 201.0), "velocity 201 commanded of roll is beyond 200 deg"),
        (command(0.5, 0.0, 4001.0), "acceleration 4001 commanded of roll is beyond 4000 deg"),
        (command(17.0, 199.0), "stopping distance 21.95.* commanded of roll is beyond 20 deg"),
        (command(8.0), "step of the position .* commanded of roll is beyond 1.264 deg"),
        (command(np.nan), "position nan commanded of roll is beyond"),
        (command(0.5, 1e200), r"velocity 1e\+200 commanded of roll is beyond"),
    ],
)
def test_a_command_beyond_a_limit_is_not_followed(wrong, words):
    far = armed()
    follow(far, 30, amplitude=1.0)
    before = far.tick().position
    far.receive(said(Kind.COMMAND, number=31, command=wrong), now=31)
    for _ in range(200):
        order = far.tick()
    assert far.state is State.FAULT
    import re

    assert re.match(words, far.fault)
    assert np.abs(order.position - before).max() < 0.5


def test_a_command_for_other_axes_brakes():
    far = armed()
    follow(far, 20)
    one = Command(position=np.zeros(1), velocity=np.zeros(1), acceleration=np.zeros(1))
    far.receive(said(Kind.COMMAND, number=20, command=one), now=0)
    assert far.state is State.BRAKING
    assert far.fault == "a command for 1 axes came, and there are 2"


def test_a_second_run_is_refused_while_the_first_moves_and_welcome_later():
    far = armed()
    follow(far, 60)
    (answer,) = far.receive(said(Kind.HELLO, session=10, text=Hello().to_json()), now=0)
    assert unpack(answer).kind is Kind.REFUSED
    assert unpack(answer).text == "'bench' is busy with another run (moving)"
    # Nothing that the stranger sends has any effect.
    far.receive(said(Kind.STOP, session=10), now=0)
    assert far.state is State.MOVING
    while far.state in (State.MOVING, State.BRAKING):
        far.tick()
    away = far.tick().position[0]
    assert away > 0.1
    (answer,) = far.receive(said(Kind.HELLO, session=10, text=Hello().to_json()), now=0)
    assert unpack(answer).kind is Kind.WELCOME
    far.receive(said(Kind.ARM, session=10), now=0)
    velocity = []
    while far.state is not State.ARMED:
        velocity.append(far.tick().velocity[0])
    assert far.tick().position[0] == 0.0
    # Home along a quintic, with a tenth of what it may.
    assert np.abs(velocity).max() <= 0.1 * 200.0
    assert np.abs(np.diff(velocity)).max() / T <= 1.05 * 0.1 * 4000.0


def test_a_faster_clock_at_the_near_end_costs_a_command_now_and_then_and_no_fault():
    far = armed()
    sent = 0
    for n in range(4000):
        while sent <= n * 1.001:  # 1000 ppm
            far.receive(said(Kind.COMMAND, number=sent, command=cosine(5.0, 1.0, sent * T)), now=n)
            sent += 1
        far.tick()
    assert far.state is State.MOVING
    assert far.reckoned == 0
    assert far.late == 0


def test_a_slower_clock_at_the_near_end_is_waited_for():
    far = armed()
    sent = 0
    for n in range(4000):
        while sent <= n * 0.999:
            far.receive(said(Kind.COMMAND, number=sent, command=cosine(5.0, 1.0, sent * T)), now=n)
            sent += 1
        far.tick()
    assert far.state is State.MOVING
    # Four ticks too many; until it shifts its turn, at most fifty commands at a time are late.
    assert 4 <= far.reckoned <= 4 * 60


def test_a_far_end_states_what_it_is():
    with pytest.raises(RigError, match="must state its axes, its rate and its watchdog"):
        FarEnd(Hello(name="x", axes=("a",), units=("deg",)))


def test_what_is_no_datagram_is_answered_with_a_reason():
    far = FarEnd(hello())
    (answer,) = far.receive(b"GET /", now=0)
    assert unpack(answer).kind is Kind.REFUSED
    assert "no datagram of hmpim" in unpack(answer).text
