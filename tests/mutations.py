"""Files damaged by chance, from one seed: what copying, killing and editing do to them."""

import contextlib
import signal
from collections.abc import Iterator

import numpy as np

from hmpim.errors import HmpimError
from hmpim.formats import read
from hmpim.formats.survey import survey

GUARD = 300  # seconds after which a file counts as a hang; a good one takes hundredths of one


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """Return the bytes of a file with one to four things done to them."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        if not out:
            break
        kind = int(rng.integers(0, 9))
        at = int(rng.integers(0, len(out)))
        length = int(min(len(out) - at, 1 + rng.geometric(0.05)))
        if kind == 0:  # bits flipped
            for place in rng.integers(0, len(out), size=int(rng.integers(1, 20))):
                out[place] ^= 1 << int(rng.integers(0, 8))
        elif kind == 1:  # cut short
            del out[at:]
        elif kind == 2:  # a hole
            del out[at : at + length]
        elif kind == 3:  # noise over it
            out[at : at + length] = rng.bytes(length)
        elif kind == 4:  # zeros, as a disk leaves them
            out[at : at + length] = bytes(length)
        elif kind == 5:  # something twice
            out[at:at] = out[at : at + length]
        elif kind == 6:  # noise between
            out[at:at] = rng.bytes(length)
        elif kind == 7:  # largest and smallest counts, where a size may stand
            size = int(rng.choice([2, 4, 8]))
            out[at : at + size] = (b"\xff" if rng.integers(2) else b"\x7f") * min(
                size, len(out) - at
            )
        else:  # the beginning gone
            del out[: int(rng.integers(1, min(len(out), 400) + 1))]
    return bytes(out)


@contextlib.contextmanager
def guarded(what: str) -> Iterator[None]:
    """Turn a hang into a failure."""

    def hung(*_: object) -> None:
        raise AssertionError(f"{what} has not ended after {GUARD} s")

    before = signal.signal(signal.SIGALRM, hung)
    signal.alarm(GUARD)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def read_or_refused(path, look=True, **wanted) -> str:
    """Read a file, and look at all of it; return what came of both. Only our own errors pass."""
    outcomes = []
    for door in (lambda: read(path, **wanted), lambda: survey(path))[: 1 + look]:
        with guarded(str(path)):
            try:
                door()
            except HmpimError as error:
                message = str(error)
                assert message
                assert "\n" not in message
                assert len(message) < 2000
                outcomes.append("refused")
            else:
                outcomes.append("read")
    return "/".join(outcomes)
