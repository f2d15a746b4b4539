"""What a report says of the test beyond its result: unit under test, test, operator, date."""

from dataclasses import dataclass

__all__ = ["About"]


@dataclass(frozen=True, slots=True, kw_only=True)
class About:
    """Who tested what, and when; what is left empty is left out.

    Parameters
    ----------
    title : str
        Heading of the report; the names of the channels by default.
    under_test : str
        Unit under test: name, part number, serial number.
    test : str
        Which test, such as its number in a plan.
    operator : str
        Who ran it.
    date : str
        When it was run; the day on which the report is made by default.

    Examples
    --------
    >>> About(under_test="Gyro 12", operator="M. Hebert").title
    ''
    """

    title: str = ""
    under_test: str = ""
    test: str = ""
    operator: str = ""
    date: str = ""
