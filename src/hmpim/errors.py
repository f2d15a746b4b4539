"""The errors of hmpim, and nothing else.

Every one says in one sentence which value is wrong and what to do::

    HmpimError
    ├── ArgumentError (ValueError)       an argument of a call is off
    │   ├── UnitError                    a unit is unknown, or of the wrong dimension
    │   └── LimitsError                  limits and wishes cannot both be met
    ├── RecordError (ValueError)         the data cannot be used: NaN, gaps, unequal lengths, dead
    ├── FormatError (ValueError)         a file cannot be read as what it claims to be
    ├── RigError (RuntimeError)          the unit under test refused, failed or was stopped
    └── MissingExtraError (ImportError)  an optional package is not installed
"""

__all__ = [
    "ArgumentError",
    "FormatError",
    "HmpimError",
    "LimitsError",
    "MissingExtraError",
    "RecordError",
    "RigError",
    "UnitError",
]


class HmpimError(Exception):
    """Base of every error that hmpim raises on purpose."""


class ArgumentError(HmpimError, ValueError):
    """An argument is outside what it may be; the message quotes it."""


class UnitError(ArgumentError):
    """A unit is unknown or has the wrong dimension."""


class LimitsError(ArgumentError):
    """Limits and wishes cannot both be met; the message says what is enough."""


class RecordError(HmpimError, ValueError):
    """The recorded data cannot be used as they are."""


class FormatError(HmpimError, ValueError):
    """A file cannot be read as what it claims to be."""


class RigError(HmpimError, RuntimeError):
    """The unit under test refused, failed or was stopped."""


class MissingExtraError(HmpimError, ImportError):
    """An optional package is needed; the message names the extra to install."""
