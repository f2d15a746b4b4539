"""Builders of rigs with a camera: options of scene and camera stand in tables of their own."""

import dataclasses
from typing import Any

from hmpim.errors import FormatError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.catalogue.simulated import build_table, made_of, take_options
from hmpim.rigs.seeker import SeekerRig
from hmpim.rigs.software.code import Fresh, load_code
from hmpim.rigs.tracker import TRACKERS, Camera, Scene, TrackerRig

__all__ = ["build_seeker", "build_tracker", "with_camera"]


def build_tracker(argument: str, description: Description) -> TrackerRig:
    """Make a rig of ``tracker``.

    Options: `tracker` ('centroid', 'template', 'csrt', or FILE:FUNCTION), `scale_factor`,
    `boresight`, and the tables `scene` and `camera`.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> options = {"tracker": "template", "camera": {"frame_rate": 50.0}}
    >>> build_tracker("", describe({"options": options})).camera.frame_rate
    50.0
    """
    if argument:
        raise FormatError(f"tracker:{argument}: a tracker takes no argument; write tracker")
    known = {f.name for f in dataclasses.fields(TrackerRig) if f.init} - {"reset"}
    options = take_options(description, known, kind="tracker", instead={"limits": "limits"})
    return made_of(TrackerRig, with_camera(options), kind_name="tracker")


def build_seeker(argument: str, description: Description) -> SeekerRig:
    """Make a rig of ``seeker``.

    Options: those of `SeekerRig`, and the tables `scene`, `camera`, and `table` with options of
    the motion table.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> options = {"track_gain": 4.0, "table": {"delay": 0.002}}
    >>> build_seeker("", describe({"options": options})).table.delay
    0.002
    """
    if argument:
        raise FormatError(f"seeker:{argument}: a seeker takes no argument; write seeker")
    known = {f.name for f in dataclasses.fields(SeekerRig) if f.init} - {"reset"}
    options = take_options(
        description, known, kind="seeker", instead={"limits": "limits"}, loaded=True
    )
    given = options.get("table", {})
    if not isinstance(given, dict):
        raise FormatError("option 'table' must be a table of the motion table's options")
    options["table"] = build_table(
        "", Description(load=description.load, mode=description.mode or "PVA", options=given)
    )
    return made_of(SeekerRig, with_camera(options), kind_name="seeker")


def with_camera(options: dict[str, Any]) -> dict[str, Any]:
    """Turn the tables `scene` and `camera` and a tracker's file into what rigs take.

    Raises
    ------
    FormatError
        If a table holds something that is not known.
    RigError
        If there is no such file or function.

    Examples
    --------
    >>> with_camera({"scene": {"width": 64}})["scene"].width
    64
    """
    made = dict(options)
    kinds: tuple[tuple[str, type[Any]], ...] = (("scene", Scene), ("camera", Camera))
    for name, kind in kinds:
        if name not in made:
            continue
        known = sorted(f.name for f in dataclasses.fields(kind))
        if not isinstance(made[name], dict):
            raise FormatError(f"option {name!r} must be a table; known in it are {known}")
        strange = sorted(set(made[name]) - set(known))
        if strange:
            raise FormatError(f"{name}.{strange[0]} is not known; known are {', '.join(known)}")
        made[name] = made_of(kind, made[name], kind_name=name)
    tracker = made.get("tracker")
    if isinstance(tracker, str) and tracker not in TRACKERS and ":" in tracker:
        file, _, function = tracker.rpartition(":")
        made["tracker"] = load_code(file, function)
        if isinstance(made["tracker"], Fresh):
            made["reset"] = made["tracker"].reset
    return made
