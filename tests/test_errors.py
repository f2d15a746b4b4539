"""The tree of errors is what its docstring draws."""

import re

import pytest

import hmpim.errors as errors

BUILT_IN = {"ValueError": ValueError, "RuntimeError": RuntimeError, "ImportError": ImportError}


def drawn():
    """Yield (name, parent, built-in parent or None) from the drawing."""
    parents = ["HmpimError"]
    for line in errors.__doc__.splitlines():
        match = re.search(r"([├└]── )(\w+)(?: \((\w+)\))?", line)
        if match is None:
            continue
        depth = (match.start(1) - 4) // 4
        del parents[depth + 1 :]
        yield match[2], parents[depth], match[3]
        parents.append(match[2])


def test_the_drawing_shows_every_error():
    assert {"HmpimError", *(name for name, _, _ in drawn())} == set(errors.__all__)


@pytest.mark.parametrize(("name", "parent", "built_in"), list(drawn()))
def test_each_derives_as_drawn(name, parent, built_in):
    error = getattr(errors, name)
    assert getattr(errors, parent) in error.__bases__
    if built_in is not None:
        assert issubclass(error, BUILT_IN[built_in])


def test_bad_arguments_and_bad_data_are_value_errors_too():
    for name in ("ArgumentError", "UnitError", "LimitsError", "RecordError", "FormatError"):
        assert issubclass(getattr(errors, name), ValueError)
