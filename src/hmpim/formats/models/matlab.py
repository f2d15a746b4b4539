"""MATLAB: a function that returns the model; GNU Octave runs it too."""

from pathlib import Path

from hmpim.formats.atomic import write_text
from hmpim.formats.models.refined import refined_values
from hmpim.formats.models.render import c_number, rendered
from hmpim.formats.models.source import Source
from hmpim.identify import Estimate

__all__ = ["write_matlab"]


def write_matlab(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the function; its file must keep its name, which is the function's."""
    model, pair = source.causal(), source.pair
    spread = model.spread
    text = rendered(
        "model.m.jinja",
        name=source.name,
        lines=source.program_lines(),
        input=_quoted(pair.input),
        output=_quoted(pair.output),
        output_unit=_quoted(model.output_unit),
        sha256=source.record.sha256,
        version=source.version,
        estimates=[(name, estimate) for name, estimate in source.estimates()],
        ends=_ends,
        covariance=[] if spread is None else spread.covariance,
        **refined_values(source),
    )
    write_text(path, text)
    return (path,)


def _quoted(text: str) -> str:
    return text.replace("'", "''").replace("\n", " ")


def _ends(estimate: Estimate) -> str:
    ends = estimate.ci95
    if ends is None:
        return "NaN, NaN"
    return ", ".join("NaN" if end is None else c_number(end) for end in ends)
