"""Python: one file that needs nothing else installed."""

from pathlib import Path

from hmpim.formats.atomic import write_text
from hmpim.formats.models.c import accuracy
from hmpim.formats.models.render import chain_context, literal, rendered
from hmpim.formats.models.source import Source

__all__ = ["python_file", "write_python"]


def python_file(source: Source) -> str:
    """Return the text of the file."""
    chain = source.chain()
    spread = source.model.spread
    covariance = None if spread is None else [list(row) for row in spread.covariance]
    return rendered(
        "model.py.jinja",
        name=source.name,
        title=f"{source.pair.output} from {source.pair.input}, one sample at a time.",
        lines=source.program_lines(stepped=True),
        said=accuracy(chain),
        parameters=literal({k: e.to_dict() for k, e in source.estimates()}),
        covariance=literal(covariance),
        noise_std=source.model.noise_std,
        **chain_context(chain),
    )


def write_python(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the file."""
    write_text(path, python_file(source))
    return (path,)
