"""What every simulated rig and all software shares: nothing to connect, nothing that moves."""

from types import TracebackType
from typing import Any, Self

import numpy as np

from hmpim.errors import RigError

__all__ = ["Playing", "Simulated"]


class Playing:
    """What a rig remembers from `prepare` to `stop`; the rig itself stays a frozen value.

    Examples
    --------
    >>> playing = Playing()
    >>> playing.state is None
    True
    """

    __slots__ = ("rng", "state")

    def __init__(self) -> None:
        self.rng: np.random.Generator | None = None
        self.state: Any = None

    def take_rng(self) -> np.random.Generator:
        """Return the generator of this run, or a fresh one; the next run draws anew."""
        rng, self.rng = self.rng, None
        return np.random.default_rng() if rng is None else rng

    def current(self, name: str) -> Any:
        """Return what was prepared.

        Raises
        ------
        RigError
            If nothing was.
        """
        if self.state is None:
            raise RigError(f"{name!r} plays nothing that it was not prepared for; prepare it first")
        return self.state


class Simulated:
    """Context manager, `stop` and `seed` of a rig that is all in this process."""

    __slots__ = ()

    _playing: Playing

    @property
    def moves(self) -> bool:
        """False: nothing real moves, so that limits may stay unstated."""
        return False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self.stop()

    def seed(self, rng: np.random.Generator, /) -> None:
        """Draw from `rng` in the next run."""
        self._playing.rng = rng

    def stop(self) -> None:
        """Forget what was prepared."""
        self._playing.state = None
