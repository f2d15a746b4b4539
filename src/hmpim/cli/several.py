"""``hmpim identify a.csv b.csv …``: repeats of one stimulus, or one stimulus at several levels."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmpim.cli.terminal import output_console, working

if TYPE_CHECKING:
    from hmpim.identify import Levels
    from hmpim.record import Record
    from hmpim.report import About

__all__ = ["identify_several"]


def identify_several(
    records: "Sequence[Record]",
    paths: Sequence[Path],
    *,
    intersample: str,
    json: Path | None,
    quiet: bool,
    report: Path | None = None,
    about: "About | None" = None,
    notes: Sequence[str] = (),
) -> None:
    """Average repeats, or compare levels, whichever the records are."""
    from hmpim.identify import identify_levels, identify_repeats, same_at_levels
    from hmpim.report import print_levels, print_repeats
    from hmpim.report.several import levels_report, repeats_report

    names = [path.name for path in paths]
    files = names if len(set(names)) == len(names) else [str(path) for path in paths]
    with working(f"Identifying {len(records)} records"):
        if same_at_levels(records, names=files):
            levels = identify_levels(records, intersample=intersample, names=files)
            if not quiet:
                print_levels(levels, names, output_console())
            if json is not None:
                _write(_levels_dict(levels), json)
            if report is not None:
                levels_report(levels, names, report, about=about, notes=notes)
            return
        repeats = identify_repeats(records, intersample=intersample, names=files)
    if not quiet:
        print_repeats(repeats, output_console())
    if json is not None:
        _write(repeats.to_dict(), json)
    if report is not None:
        repeats_report(repeats, names, report, about=about, notes=notes)


def _levels_dict(levels: "Levels") -> dict[str, Any]:
    return {
        "schema": "hmpim/levels/1",
        "results": [result.to_dict() for result in levels.results],
        "pairs": [
            {
                "input": pair.input,
                "output": pair.output,
                "amplitude_unit": compared.unit,
                "linear_up_to": compared.linear_up_to,
                "trends": [
                    {
                        "name": trend.name,
                        "amplitudes": list(trend.amplitudes),
                        "values": list(trend.values),
                        "stds": list(trend.stds),
                        "probability": trend.probability,
                        "change": trend.change,
                    }
                    for trend in compared.trends
                ],
                "warnings": [f.to_dict() for f in compared.findings],
            }
            for pair, compared in zip(levels.results[0].pairs, levels.comparisons, strict=True)
        ],
    }


def _write(data: dict[str, Any], path: Path) -> None:
    from json import dumps

    from hmpim.formats.atomic import write_text

    write_text(path, dumps(data, indent=1, allow_nan=False) + "\n")
