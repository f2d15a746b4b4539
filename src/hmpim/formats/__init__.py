"""Files to records and back."""

from hmpim.formats.csv import write_csv
from hmpim.formats.files import read

__all__ = ["read", "write_csv"]
