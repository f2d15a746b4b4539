"""Software under test: code in a file, a program of any language, an FMU."""

from hmpim.rigs.software.code import load_code
from hmpim.rigs.software.fmu import FmuRig
from hmpim.rigs.software.process import ProcessRig

__all__ = ["FmuRig", "ProcessRig", "load_code"]
