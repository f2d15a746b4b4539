"""Many records: identified on Dask, kept as Parquet, read as one table."""

from hmpim.batch.request import Request
from hmpim.batch.run import batch
from hmpim.batch.table import BatchTable, open_table

__all__ = ["BatchTable", "Request", "batch", "open_table"]
