"""Where a constant explains an output as well as its input does."""

from hmpim.identify.result.groups import EVERY
from hmpim.record import Finding

__all__ = ["unfollowed"]


def unfollowed(output: str, source: str) -> Finding:
    """Say that an output does not follow the one input there is."""
    return Finding(
        code="unrelated",
        message=f"Output {output!r} does not follow input {source!r}: a constant explains it as "
        "well. Check the channels, or excite more.",
        severity="doubt",
        parameters=EVERY,
    )
