"""A campaign in a process of its own: each case is kept the moment it is done."""

import tomllib
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path

from hmpim.campaign.plan import Plan, parse_plan
from hmpim.campaign.run import run_campaign
from hmpim.campaign.study import make_study
from hmpim.campaign.write import headline, write_study
from hmpim.errors import ArgumentError, FormatError, HmpimError
from hmpim.formats.atomic import write_text

__all__ = ["Done", "Failed", "Step", "checked_plan", "conduct"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """How far a campaign is, from 0 to 1, and what comes next."""

    share: float
    what: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """A study is written; `words` is its headline."""

    words: str
    met: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """A campaign ended by a fault; what was done by then is kept."""

    why: str


def checked_plan(text: str) -> Plan:
    """Read a plan that was typed into a page.

    Raises
    ------
    FormatError, ArgumentError
        If it is no plan, or names code or files: those come from the command line alone.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"the plan is not valid TOML: {error}") from error
    plan = parse_plan(data)
    if plan.rig.kind == "python":
        raise ArgumentError(
            "a plan on this page may not name code (rig.kind = 'python'): use hmpim campaign"
        )
    if plan.compare:
        raise ArgumentError("a plan on this page may not name a file to compare with; leave it out")
    return plan


def conduct(pipe: Connection, text: str, folder: str, fresh: bool) -> None:
    """Run a campaign, or go on with it; the body of the process."""
    place = Path(folder)
    try:
        plan = replace(checked_plan(text), folder=str(place))
        place.mkdir(parents=True, exist_ok=True)
        cases = run_campaign(
            plan,
            place,
            fresh=fresh,
            progress=lambda done, total, what: pipe.send(
                Step(share=done / max(total, 1), what=what)
            ),
        )
        study = make_study(plan, cases)
        write_study(study, place)
        write_text(place / "plan.toml", text)
        pipe.send(Done(words=headline(study), met=study.met))
    except (HmpimError, OSError) as error:
        pipe.send(Failed(why=" ".join(str(error).split())))
