"""What is seen of tests before they run."""

from collecting import ABSENT


def test_every_fixture_is_there(request):
    """A study would else say so in `make studies` alone."""
    assert request.config.stash[ABSENT] == []
