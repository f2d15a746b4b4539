"""Files to records, stimuli and results, and back."""

from hmpim.formats.csv import write_csv
from hmpim.formats.files import read
from hmpim.formats.saving import load, save

__all__ = ["load", "read", "save", "write_csv"]
