"""Rigs by name, by kind and by address: files, entry points, and what makes a rig of them."""

from hmpim.rigs.catalogue.description import (
    Description,
    StatedLimits,
    describe,
    read_description,
)
from hmpim.rigs.catalogue.find import FoundRig, check_described, check_rig, find_rig
from hmpim.rigs.catalogue.kinds import KINDS, Builder, Kind, Offered, load_builder, offered_kinds
from hmpim.rigs.catalogue.named import NamedRig, config_files, named_rigs
from hmpim.rigs.catalogue.simulated import made_of, take_options

__all__ = [
    "KINDS",
    "Builder",
    "Description",
    "FoundRig",
    "Kind",
    "NamedRig",
    "Offered",
    "StatedLimits",
    "check_described",
    "check_rig",
    "config_files",
    "describe",
    "find_rig",
    "load_builder",
    "made_of",
    "named_rigs",
    "offered_kinds",
    "read_description",
    "take_options",
]
