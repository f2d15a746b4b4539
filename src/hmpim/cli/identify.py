"""``hmpim identify``: a measured record in, a table, a JSON file and a page out."""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from hmpim.cli.compress import refuse_twice, runs_of, statistics_of
from hmpim.cli.files import check_files
from hmpim.cli.paging import (
    Date,
    Figures,
    Note,
    Operator,
    Sign,
    Test,
    Title,
    UnderTest,
    about_of,
    check_paper,
    tables_in,
    write_beside,
)
from hmpim.cli.reading import (
    Auxiliary,
    Beside,
    Common,
    From,
    Input,
    Offset,
    Output,
    Rate,
    Sheet,
    StampChoice,
    Stamps,
    Sweep,
    Time,
    To,
    Unit,
    read_records,
    reading,
    refuse_options,
    units_of,
)
from hmpim.cli.several import identify_several
from hmpim.cli.terminal import output_console, say, working
from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from hmpim.identify import Estimate, Identification, Statistics
    from hmpim.model.dynamics import StructureName
    from hmpim.record import Record
    from hmpim.report import About
    from hmpim.report.figures import Picture
    from hmpim.stimulus import Stimulus

__all__ = ["Between", "identify", "write_result"]


class Between(StrEnum):
    """What the input does between its samples."""

    AUTO = "auto"
    ZOH = "zoh"
    FOH = "foh"
    BANDLIMITED = "bandlimited"
    FEEDFORWARD = "feedforward"
    SAMPLED = "sampled"


class Kept(StrEnum):
    """What becomes of a nonlinearity."""

    MODELLED = "modelled"
    REPORTED = "reported"


def identify(
    records: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORD",
            help="File with the record, such as a CSV file with a header. Several records of one"
            " stimulus are averaged, and their error bars compared with their scatter; "
            "records at several amplitudes show where the unit is linear. Files of hmpim compress "
            "are joined.",
        ),
    ],
    input_: Input = None,
    output: Output = None,
    auxiliary: Auxiliary = None,
    fs: Rate = None,
    time: Time = None,
    unit: Unit = None,
    from_: From = None,
    to: To = None,
    sweep: Sweep = None,
    offset: Offset = None,
    beside: Beside = None,
    common: Common = None,
    stamps: StampChoice = Stamps.AUTO,
    sheet: Sheet = None,
    together: Annotated[
        bool,
        typer.Option(
            "--together",
            help="Fit one model to all records, each with its own bias and initial state, "
            "instead of averaging or comparing them.",
        ),
    ] = False,
    intersample: Annotated[
        Between,
        typer.Option(
            "--intersample",
            help="What the input does between samples. zoh: held; foh: linear; bandlimited; "
            "feedforward: held, as are its velocity and acceleration commands; sampled: software; "
            "auto: found from the record.",
        ),
    ] = Between.AUTO,
    reference: Annotated[
        str | None,
        typer.Option(
            "--reference",
            metavar="NAME",
            help="Channel that drives a loop around the unit: identify the unit through it.",
        ),
    ] = None,
    nonlinear: Annotated[
        Kept,
        typer.Option(
            "--nonlinear",
            help="How to treat backlash, a dead zone, friction or a spring. modelled: include it "
            "in the model and give the linear part's figures; reported: only name it and give the "
            "figures of the best linear model at this amplitude.",
        ),
    ] = Kept.MODELLED,
    holdout: Annotated[
        float | None,
        typer.Option(
            "--holdout",
            metavar="FRACTION",
            help="Fit on the first part only, and predict this share at the end.",
        ),
    ] = None,
    at: Annotated[
        list[float] | None,
        typer.Option(
            "--at",
            metavar="HZ",
            help="Report gain and phase at this frequency, measured and modelled; may be repeated.",
        ),
    ] = None,
    structure: Annotated[
        list[str] | None,
        typer.Option(
            "--structure", metavar="NAME", help="Fit only this structure; may be repeated."
        ),
    ] = None,
    hand: Annotated[
        list[str] | None,
        typer.Option(
            "--hand",
            metavar="NAME=VALUE",
            help="A value read by eye, such as bandwidth_phase90=33: listed next to the "
            "estimate; may be repeated.",
        ),
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON.")
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE", help="Write one page, .html or .pdf."),
    ] = None,
    sign: Sign = None,
    figures: Figures = None,
    title: Title = "",
    under_test: UnderTest = "",
    test: Test = "",
    operator: Operator = "",
    date: Date = "",
    note: Note = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no table.")] = False,
) -> None:
    """Find every parameter of a measured record, each with its error bar.

    Several records of one test are averaged, and their scatter is compared with the stated errors;
    records at several amplitudes show where the unit is linear. --together fits all as one.
    """
    check_files(
        reads={"the record": [*records, *(beside or [])]},
        writes={
            "--json": json,
            "--report": report,
            "--sign": sign,
            "--figures": tables_in(figures),
        },
        folders={"--figures": figures},
    )
    check_paper(report, sign)
    if holdout is not None and not 0.0 < holdout < 1.0:
        raise ArgumentError(f"--holdout {holdout:g} is not a share between 0 and 1; give 0.5, say")

    single: dict[str, object] = {"--sign": sign, "--figures": figures}
    single |= {"--holdout": holdout, "--at": at or None}
    single |= {"--structure": structure or None, "--hand": hand or None}
    single["--reference"] = reference
    single["--nonlinear"] = None if nonlinear is Kept.MODELLED else nonlinear.value
    by_hand = _by_hand(hand or [])
    if together:
        named = (_once(input_, "--input"), _once(output, "--output"))
    else:
        _check_single(len(records), single)

    from hmpim.identify import identify as find
    from hmpim.identify import measurable
    from hmpim.report import print_result

    compressed = statistics_of(
        records,
        {
            **{"--input": input_, "--output": output, "--auxiliary": auxiliary, "--fs": fs},
            **{"--time": time, "--unit": unit, "--from": from_, "--to": to, "--sweep": sweep},
            **{"--offset": offset, "--beside": beside, "--common": common, "--sheet": sheet},
            **{"--reference": reference, "--holdout": holdout},
        },
    )
    roles = {"inputs": input_, "outputs": output, "auxiliary": auxiliary}
    roles["references"] = None if reference is None else [reference]
    given = (
        []
        if compressed is not None
        else read_records(
            records,
            roles=roles,
            fs=fs,
            time=time,
            units=units_of(unit),
            options=reading(
                start=from_,
                stop=to,
                sweep=sweep,
                offset=offset,
                beside=beside,
                common=common,
                stamps=stamps,
                sheet=sheet,
            ),
            every=sweep == "all",
        )
    )
    about = about_of(title, under_test, test, operator, date)
    if together and compressed is None:
        compressed = _joined(given, _named(records, given), named, single)
    elif len(given) > 1:
        _check_single(len(given), single)
        identify_several(
            given,
            _named(records, given),
            intersample=intersample.value,
            json=json,
            quiet=quiet,
            report=report,
            about=about,
            notes=note or (),
        )
        return
    held, source = (None, compressed) if compressed is not None else _held_out(given[0], holdout)
    measurable(at or [], source.fs)
    with working("Identifying"):
        result = find(
            source,
            intersample=intersample.value,
            structures=_structures(structure),
            reference=reference,
            nonlinear=nonlinear.value,
        )
    said = [] if held is None else _predictions(result, given[0], held)
    said += _readings(result, at or [])
    if by_hand:
        from hmpim.report.by_hand import hand_notes

        said += [n for pair in result.pairs for n in hand_notes(pair, by_hand, fs=source.fs)]
    if not quiet:
        print_result(result, output_console())
        for sentence in said:
            say(sentence)
    notes = [*(note or ()), *said]
    write_result(result, json=json, report=report, notes=notes, about=about)
    write_beside(result, sign=sign, figures=figures, about=about, notes=notes)


def _joined(
    given: "Sequence[Record]",
    paths: Sequence[Path],
    named: tuple[str | None, str | None],
    options: Mapping[str, object],
) -> "Statistics":
    """Records as the runs of one fit, of the input and the output that are named, if any."""
    if len(given) < 2:
        raise ArgumentError(
            "--together fits several records as one, but only one is given; leave it out, "
            "or give more"
        )
    _check_single(len(given), {name: options[name] for name in ("--reference", "--holdout")})
    names = [repr(str(path)) for path in paths]
    joined = runs_of(given, names, named)
    refuse_twice(joined, names)
    return joined


def _once(names: Sequence[str] | None, option: str) -> str | None:
    """The one name that an option was given, if any."""
    if names is not None and len(names) > 1:
        raise ArgumentError(
            f"--together fits one output to one input, and {option} is given {len(names)} times; "
            "give it once"
        )
    return names[0] if names else None


def _structures(given: "Sequence[str] | None") -> "list[StructureName] | None":
    """Structures to try; None for all. The package says which one is not known."""
    return cast("list[StructureName]", list(given)) if given else None


def _by_hand(given: Sequence[str]) -> dict[str, float]:
    """Values by parameter of NAME=VALUE."""
    values = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            raise ArgumentError(
                f"--hand {text!r} is not NAME=VALUE; write bandwidth_phase90=33"
            ) from None
    return values


def _check_single(count: int, options: Mapping[str, object]) -> None:
    """Refuse options that are about one record where there are several."""
    if count > 1:
        refuse_options(
            options, f"applies to one record, but {count} are given; leave it out, or give one"
        )


def write_result(
    result: "Identification",
    *,
    json: Path | None,
    report: Path | None,
    stimulus: "Stimulus | None" = None,
    notes: Sequence[str] = (),
    pictures: "Sequence[Picture]" = (),
    about: "About | None" = None,
    truth: Mapping[str, float] | None = None,
) -> None:
    """Write a result to the files that are wanted, each as a whole or not at all."""
    from hmpim.formats import save
    from hmpim.report import report as write_page

    if json is not None:
        save(result, json)
    if report is not None:
        with working("Drawing the page"):
            write_page(
                result,
                report,
                stimulus=stimulus,
                notes=notes,
                pictures=pictures,
                about=about,
                truth=truth,
            )


def _named(records: Sequence[Path], given: "Sequence[Record]") -> list[Path]:
    """A path for each record; the sweeps of one file are numbered."""
    if len(given) == len(records):
        return list(records)
    return [Path(f"sweep {k} of {records[0].name}") for k in range(1, len(given) + 1)]


def _readings(result: "Identification", at: Sequence[float]) -> list[str]:
    """Say gain and phase of each pair at each frequency."""
    from hmpim.identify import gain_and_phase, has_model
    from hmpim.plots.curves import is_measured

    notes = []
    for pair in result.pairs:
        if at and (not has_model(pair) or pair.covariance is None):
            notes.append(
                f"{pair.output} from {pair.input} has no model with error bars: no gain, no phase."
            )
            continue
        for found in gain_and_phase(pair, at, fs=result.record.fs) if at else ():
            measured = "not measured there"
            if found.gain_db is not None and found.phase is not None and is_measured(pair):
                measured = f"measured {_both(found.gain_db, found.phase)}"
            notes.append(
                f"{pair.output} from {pair.input} at {found.frequency:g} Hz: {measured}; "
                f"the model {_both(found.model_gain_db, found.model_phase)}"
            )
    return notes


def _both(gain: "Estimate", phase: "Estimate") -> str:
    from hmpim.report.numbers import plus_minus

    return f"{plus_minus(gain.value, gain.spread)} dB, {plus_minus(phase.value, phase.spread)}°"


def _held_out(data: "Record", share: float | None) -> "tuple[float | None, Record | Statistics]":
    """When the end begins that is to be predicted, and the rest; None and all of it of no share."""
    if share is None:
        return None, data
    start = min(float(c.time[0]) for c in (*data.inputs, *data.outputs))
    stop = max(float(c.time[-1]) for c in (*data.inputs, *data.outputs))
    split = stop - share * (stop - start)
    return split, data.between(start, split)


def _predictions(result: "Identification", data: "Record", split: float) -> list[str]:
    """Say for each pair how well its model predicts what it was not fitted on."""
    from hmpim.identify import has_model, predict

    notes = []
    for pair in result.pairs:
        name = f"Held out, {pair.input} → {pair.output}"
        if not has_model(pair):
            notes.append(f"{name}: no model to predict with.")
            continue
        found = predict(pair, data, start=split)
        notes.append(
            f"{name}: predicted from {split:.4g} s on with a fit of {found.fit_percent:.2f} %."
        )
        notes += [finding.message for finding in found.findings]
    return notes
