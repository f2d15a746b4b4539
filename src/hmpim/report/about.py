"""What a report says of the test beyond its result: unit under test, test, operator, date."""

from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version

__all__ = ["About", "made_by"]


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

    def rows(self, *, test: str = "") -> list[tuple[str, str]]:
        """Label and value of each but the title, empty where nothing is known.

        Parameters
        ----------
        test : str
            Stands for the test where none is named.
        """
        return [
            ("Unit under test", self.under_test),
            ("Test", self.test or test),
            ("Operator", self.operator),
            ("Date", self.date or datetime.now(UTC).strftime("%Y-%m-%d")),
        ]


def made_by() -> tuple[str, str]:
    """Label and value of what makes a page, and when."""
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return ("Made by", f"hmpim {version('hmpim')}, {now}")
