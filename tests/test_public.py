"""The public names: as many as a person can know, each one there and documented."""

import ast
import inspect
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

import hmpim
from tests_support import printed_by

PUBLIC = {
    "Channel", "Chirp", "Estimate", "FunctionRig", "HmpimError", "Identification", "Limits",
    "Model", "Ramp", "Record", "Sensor", "Sine", "Step", "Stimulus", "SumOfSines", "Sweep", "Until",
    "LiveEstimator", "Statistics", "batch", "compress",
    "design", "design_axes", "draw_models", "export", "frequency_response", "gentlest",
    "identify", "identify_levels", "identify_repeats", "load", "paper_analysis", "predict",
    "read", "report", "run", "save", "simulate", "to_model", "validate",
}  # fmt: skip


def test_the_public_names_are_those_agreed_on():
    assert set(hmpim.__all__) == PUBLIC
    assert list(hmpim.__all__) == sorted(hmpim.__all__)


def test_each_is_there_and_says_what_it_is():
    for name in hmpim.__all__:
        assert inspect.getdoc(getattr(hmpim, name)), name


def test_dir_shows_them_and_the_rooms_and_nothing_else():
    """What a person sees after ``hmpim.`` is what is meant for them."""
    rooms = {name for name in dir(hmpim) if not name.startswith("__")} - PUBLIC
    assert rooms == set(hmpim._ROOMS)
    for name in rooms:
        assert isinstance(getattr(hmpim, name), ModuleType)


def test_type_checkers_see_what_is_imported_when_used():
    """The imports that type checkers read, the table and ``__all__`` have the same names."""
    tree = ast.parse(Path(hmpim.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    assert isinstance(block.test, ast.Name)
    assert block.test.id == "TYPE_CHECKING"
    seen = {
        alias.asname or alias.name: node.module
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert seen == hmpim._PLACES
    assert set(seen) == set(hmpim.__all__)
    for name, place in seen.items():
        assert getattr(hmpim, name) is getattr(import_module(place), name), name


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"^module 'hmpim' has no attribute 'identfy'$") as it:
        _ = hmpim.identfy
    assert it.value.name == "identfy"
    assert it.value.obj is hmpim
    with pytest.raises(ImportError, match="cannot import name 'identfy' from 'hmpim'"):
        exec("from hmpim import identfy")


def test_a_function_is_not_replaced_by_the_package_of_its_name():
    """Also if the package is imported first; ``import hmpim.identify as f`` gives the function."""
    program = (
        "import hmpim.identify.result, hmpim.batch, hmpim.report.html\n"
        "import hmpim.identify as function\n"
        "from hmpim import batch, identify, report\n"
        "print(callable(function), callable(batch), callable(identify), callable(report))\n"
        "print(hmpim.identify is identify, hmpim.model.StructureName is not None)\n"
    )
    assert printed_by(program).split() == ["True"] * 6
