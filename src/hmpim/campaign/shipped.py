"""Plans that come with the package."""

from importlib.resources import files
from pathlib import Path

from hmpim.errors import ArgumentError

__all__ = ["PLANS", "shipped_plan"]

PLANS = ("demo", "example", "section_v", "section_v_reduced")


def shipped_plan(name: str) -> Path:
    """Path of a plan that comes with the package.

    Raises
    ------
    ArgumentError
        If there is none of this name.

    Examples
    --------
    >>> shipped_plan("section_v").name
    'section_v.toml'
    """
    if name not in PLANS:
        raise ArgumentError(f"plan {name!r} does not ship; there are {', '.join(PLANS)}")
    return Path(str(files("hmpim.campaign").joinpath("plans", f"{name}.toml")))
