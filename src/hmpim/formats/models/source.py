"""What every export starts from: one pair of a result, with its errors and where it comes from."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from importlib.metadata import version

from hmpim.arguments import check_size
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify import (
    Estimate,
    Identification,
    PairIdentification,
    RecordSummary,
    has_model,
    to_model,
)
from hmpim.model import Chain, Model
from hmpim.record import Intersample, is_held

__all__ = ["LINEAR_PART", "Source", "ascii_of", "identifier", "source_of"]

LINEAR_PART = "The file holds the linear part alone: "
"""How the note of an export begins that lacks a nonlinearity."""

_MOST_LATE = 1e7
"""Samples that a program can keep: 80 MB."""

_NEGLIGIBLE = 3.0
"""Standard deviations up to which a negative delay counts as none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Source:
    """A model to be exported, and what is to be said about it.

    Parameters
    ----------
    name : str
        Identifier in the target's language: letters, digits and underscores.
    model : Model
        What was identified, whole chain and errors included.
    pair : PairIdentification
        Where it comes from: estimates with error bars, measured response, verdict, warnings.
    record : RecordSummary
        Which record that was.
    version : str
        Of hmpim.
    fs : float
        Rate in Hz at which stepped targets run.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}
        What the input does between its samples.
    note : str
        What the target has of a nonlinearity; empty of a linear unit.
    """

    name: str
    model: Model
    pair: PairIdentification
    record: RecordSummary
    version: str
    fs: float
    intersample: Intersample
    note: str = ""

    def estimates(self) -> Iterator[tuple[str, Estimate]]:
        """Yield every parameter that the record determines, with its name."""
        parameters = self.pair.parameters
        for field in fields(parameters):
            estimate = getattr(parameters, field.name)
            if estimate is not None:
                yield field.name, estimate

    def lines(self) -> list[str]:
        """Say in plain lines what the model is, how sure it is, and where it comes from."""
        record, pair = self.record, self.pair
        where = f" ({record.source})" if record.source else ""
        said = [
            f"{pair.output} from {pair.input}: {pair.structure}, fit {pair.fit_percent:.2f} %, "
            f"verdict {pair.verdict}.",
            f"Identified by hmpim {self.version} from a record of {record.samples} samples at "
            f"{record.fs:.9g} Hz{where},",
            f"sha256 {record.sha256}.",
            "Parameter: value +- standard deviation [95 % interval] unit.",
        ]
        said += [f"  {name}: {_words(estimate)}" for name, estimate in self.estimates()]
        said += [f"Warning ({w.code}): {w.message}" for w in pair.warnings]
        said += [self.note] if self.note else []
        return [ascii_of(line) for line in said]

    @property
    def moved_before(self) -> bool:
        """Whether the input is held and moves less than a sample before it is taken.

        A program that is stepped then knows what it needs: what is held at a sample has been
        answered since it moved.
        """
        return is_held(self.intersample) and -1.0 < self.model.delay * self.fs < 0.0

    def program_lines(self, *, stepped: bool = False) -> list[str]:
        """Say what `lines` says, and what a program has in place of a negative delay.

        Parameters
        ----------
        stepped : bool
            Whether the program runs at the export's rate, from `chain`.
        """
        late = -self.model.delay
        if late <= 0.0:
            return self.lines()
        if stepped and self.moved_before:
            words = f"is kept: the held input moves {late:.6g} s before each sample of it is taken."
        elif self.moved_before:
            words = (
                f"is taken as 0: exact for an input that is moved {late:.6g} s before its samples "
                f"were taken, else outputs come {late:.6g} s late."
            )
        else:
            words = f"cannot be stepped and is taken as 0: outputs come {late:.6g} s late."
        return [*self.lines(), f"The delay of {-late:.6g} s {words}"]

    def causal(self) -> Model:
        """Return the model as something that can be stepped: its delay not negative.

        Raises
        ------
        ArgumentError
            If the delay is negative by more than its error.
        """
        delay = self.model.delay
        if delay >= 0.0:
            return self.model
        estimate = self.pair.parameters.delay
        spread = 0.0 if estimate is None else estimate.spread
        std = spread if math.isfinite(spread) else 0.0
        if -delay <= _NEGLIGIBLE * std:
            return replace(self.model, delay=0.0)
        which = f"the delay of {self.pair.output!r} from {self.pair.input!r} is {delay:.6g} s"
        if self.moved_before:
            raise ArgumentError(
                f"{which}: the held input moves before it is sampled, which only what is stepped "
                "with its samples can follow; export to c, python, fmu, json, csv or uff58"
            )
        raise ArgumentError(
            f"{which}, so the output is ahead of the input and no program can step it; export to "
            "json, csv or uff58, or identify from a command that comes earlier"
        )

    def chain(self) -> Chain:
        """Return the model at the export's rate."""
        model = self.model if self.moved_before else self.causal()
        if model.delay * self.fs > _MOST_LATE:
            raise ArgumentError(
                f"fs = {self.fs:g} Hz is too fast for a program: the delay of {model.delay:.4g} s "
                f"is {model.delay * self.fs:.3g} samples, which it would keep; give a lower rate"
            )
        return model.at_rate(self.fs, intersample=self.intersample)


def source_of(
    result: Identification,
    *,
    name: str,
    pair: tuple[str, str] | None = None,
    fs: float | None = None,
    intersample: Intersample | None = None,
) -> Source:
    """Choose what is exported.

    Parameters
    ----------
    result : Identification
        From `hmpim.identify`, or read back.
    name : str
        What the model is to be called; characters that no identifier has become underscores.
    pair : tuple of str, optional
        Output and input; the only one that has a model by default.
    fs : float, optional
        Rate in Hz of stepped targets; that of the record by default.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}, optional
        What the input does between its samples; as identified by default.

    Raises
    ------
    ArgumentError
        If several pairs have a model and none is chosen, or the rate is not positive.
    RecordError
        If the record does not determine a figure that the model needs.
    """
    if pair is not None:
        chosen = result[pair]
    else:
        known = [p for p in result.pairs if has_model(p)]
        if len(known) > 1:
            raise ArgumentError(
                f"the result has {len(known)} models ("
                + ", ".join(f"{p.output} from {p.input}" for p in known)
                + "); choose one with pair=(output, input), or --output and --input"
            )
        if not result.pairs:
            raise RecordError("the result has no pair of channels, so there is no model")
        chosen = known[0] if known else result.pairs[0]
    rate = result.record.fs if fs is None else fs
    if not rate > 0:
        raise ArgumentError(f"fs = {rate!r} Hz is not a rate; give a positive number")
    check_size("fs", rate, "Hz")
    model = to_model(chosen, fs=result.record.fs)
    return Source(
        name=identifier(name),
        model=model,
        pair=chosen,
        record=result.record,
        version=version("hmpim"),
        fs=float(rate),
        intersample=intersample or model.intersample,
    )


def identifier(name: str) -> str:
    """Turn a name into one of letters, digits and underscores.

    Examples
    --------
    >>> identifier("2nd axis.az")
    'm2nd_axis_az'
    """
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "model"
    return f"m{plain}" if plain[0].isdigit() else plain


def _words(estimate: Estimate) -> str:
    said = f"{estimate.value:.9g}"
    if estimate.std is not None:
        said += f" +- {estimate.std:.2g}"
    if estimate.ci95 is not None:
        low, high = ("open" if end is None else f"{end:.9g}" for end in estimate.ci95)
        said += f" [{low}, {high}]"
    said = f"{said} {estimate.unit}".rstrip()
    return said if estimate.verdict == "ok" else f"{said} (doubtful)"


def ascii_of(line: str) -> str:
    """Keep what every compiler reads: comments of other characters differ between them."""
    for sign, plain in (("→", "->"), ("±", "+-"), ("²", "^2"), ("³", "^3"), ("°", "deg")):
        line = line.replace(sign, plain)
    plain = line.encode("ascii", "replace").decode("ascii").replace("*/", "* /")
    return " ".join(plain.split("\n")).rstrip("\\")
