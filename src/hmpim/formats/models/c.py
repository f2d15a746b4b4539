"""C99: a header and a source file, nothing but the standard library."""

from pathlib import Path

from hmpim.formats.atomic import write_text
from hmpim.formats.models.render import chain_context, rendered
from hmpim.formats.models.source import Source
from hmpim.model import Chain

__all__ = ["accuracy", "c_files", "write_c"]


def accuracy(chain: Chain) -> str:
    """Say in a sentence how near a stepped export is to the model.

    Examples
    --------
    >>> from hmpim.model import Model
    >>> accuracy(Model(delay=0.01, scale_factor=2.0).at_rate(100.0, intersample="zoh"))
    'Exact at 100 Hz for an input that is held between its samples, delay included.'
    """
    step = chain.step
    if chain.error == 0.0:
        between = {
            "zoh": "held",
            "foh": "linear",
            "bandlimited": "band-limited",
            "feedforward": "held",
            "sampled": "sampled",
        }[step.intersample]
        return (
            f"Exact at {step.fs:.9g} Hz for an input that is {between} between its samples, "
            "delay included."
        )
    fed = "for a command that is held with its derivatives"
    words = fed if step.intersample == "feedforward" else "for a band-limited input"
    return (
        f"At {step.fs:.9g} Hz, {words}: response within {chain.error:.1e} of the "
        f"model, delay included, up to {step.band:.4g} Hz; beyond, gain up to {step.gain:.3g}."
    )


def c_files(source: Source, chain: Chain) -> dict[str, str]:
    """Return the text of each file by its name."""
    context = {
        "name": source.name,
        "lines": source.program_lines(stepped=True),
        "said": accuracy(chain),
        **chain_context(chain),
    }
    return {
        f"{source.name}.h": rendered("model.h.jinja", **context),
        f"{source.name}.c": rendered("model.c.jinja", **context),
    }


def write_c(source: Source, folder: Path) -> tuple[Path, ...]:
    """Write header and source into a folder, made if it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, text in c_files(source, source.chain()).items():
        write_text(folder / name, text)
        written.append(folder / name)
    return tuple(written)
