"""MATLAB: a function that returns the model; GNU Octave runs it too."""

from pathlib import Path

from hmpim.formats.atomic import write_text
from hmpim.formats.models.refined import REFINE, refined_words
from hmpim.formats.models.render import c_number, rendered
from hmpim.formats.models.source import Source
from hmpim.identify import Estimate

__all__ = ["write_matlab"]


def write_matlab(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the function; its file must keep its name, which is the function's."""
    model, pair = source.causal(), source.pair
    system, seen = model.system, pair.frequency_response
    integrates = bool(system.denominator[0] == 0.0)
    spread = model.spread
    text = rendered(
        "model.m.jinja",
        name=source.name,
        lines=source.lines(),
        said=refined_words(source),
        input=_quoted(pair.input),
        output=_quoted(pair.output),
        output_unit=_quoted(model.output_unit),
        delay=model.delay,
        numerator=system.numerator[::-1],
        denominator=system.denominator[::-1],
        level=0.0 if integrates else float(system.numerator[0] / system.denominator[0]),
        integrates=integrates,
        bias=model.bias,
        noise_std=model.noise_std,
        low=model.saturation_low,
        high=model.saturation_high,
        hold_period=model.hold_period,
        quantum=model.quantization_step,
        intersample=source.intersample,
        fs=source.fs,
        refine=REFINE,
        sha256=source.record.sha256,
        version=source.version,
        estimates=[(name, estimate) for name, estimate in source.estimates()],
        ends=_ends,
        covariance=[] if spread is None else spread.covariance,
        frequency=seen.frequency,
        real=seen.response.real,
        imag=seen.response.imag,
        std=seen.std,
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
