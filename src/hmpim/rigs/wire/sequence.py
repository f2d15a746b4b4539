"""Numbers that should come one after the other: what was lost, late, doubled or swapped."""

from dataclasses import dataclass

__all__ = ["Counts", "Sequence"]

_MEMORY = 4096  # numbers remembered; what is older is late, doubled or not


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """What became of a sequence.

    Parameters
    ----------
    received : int
        Datagrams that came, each number once.
    lost : int
        Numbers that never came.
    doubled : int
        Datagrams that came once more.
    swapped : int
        Those that came after a later one.
    """

    received: int
    lost: int
    doubled: int
    swapped: int

    @property
    def clean(self) -> bool:
        """Whether every number came once, in order."""
        return self.lost == self.doubled == self.swapped == 0


class Sequence:
    """Counts as numbers arrive, in whatever order.

    Examples
    --------
    >>> seen = Sequence()
    >>> [seen.arrived(n) for n in (0, 1, 3, 2, 3, 6)]
    [True, True, True, True, False, True]
    >>> seen.counts
    Counts(received=5, lost=2, doubled=1, swapped=1)
    """

    def __init__(self) -> None:
        self._first = 0
        self._highest: int | None = None
        self._seen: set[int] = set()
        self._received = self._doubled = self._swapped = 0

    def arrived(self, number: int) -> bool:
        """Take a number; False if it has been here before."""
        if self._highest is None:
            self._first = self._highest = number
        elif number in self._seen or number <= self._highest - _MEMORY:
            self._doubled += 1
            return False
        elif number < self._highest:
            self._swapped += 1
            self._first = min(self._first, number)
        else:
            self._highest = number
        self._received += 1
        self._seen.add(number)
        if len(self._seen) > 2 * _MEMORY:
            self._seen = {n for n in self._seen if n > self._highest - _MEMORY}
        return True

    @property
    def counts(self) -> Counts:
        """What became of it so far; numbers after the last to come are not counted as lost."""
        if self._highest is None:
            return Counts(received=0, lost=0, doubled=0, swapped=0)
        expected = self._highest - self._first + 1
        return Counts(
            received=self._received,
            lost=expected - self._received,
            doubled=self._doubled,
            swapped=self._swapped,
        )
