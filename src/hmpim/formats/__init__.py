"""Files to records and back."""

from hmpim.formats.csv import read_csv, write_csv
from hmpim.formats.files import read

__all__ = ["read", "read_csv", "write_csv"]
