"""The public names: as many as a person can know, each one there and documented."""

import ast
import inspect
from pathlib import Path

import hmpim

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


def test_nothing_else_is_imported_at_the_top():
    """What a person sees after ``hmpim.`` is what is meant for them."""
    tree = ast.parse(Path(hmpim.__file__).read_text(encoding="utf-8"))
    imported = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert imported == PUBLIC
