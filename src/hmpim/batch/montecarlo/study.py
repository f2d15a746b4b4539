"""The page of a Monte Carlo study."""

import numpy as np

from hmpim.batch.montecarlo.plan import Plan
from hmpim.batch.montecarlo.summary import FAR, MonteCarlo, Region, Share
from hmpim.identify.result.groups import FIXED_UNITS
from hmpim.plots import Axis, Figure, Panel, Points, Rule
from hmpim.plots.style import axis_label
from hmpim.report.about import made_by
from hmpim.report.figures import Picture
from hmpim.report.study import Grid, Section, StudyPage
from hmpim.report.words import label_of

__all__ = ["montecarlo_page"]

_STATED = 0.95
_SHORT = {
    "delay_low_frequency": "delay at DC",
    "scale_factor": "scale",
    "noise_std": "noise",
    "natural_frequency": "fn",
    "damping_ratio": "ζ",
    "time_constant": "T",
    "bandwidth_phase90": "−90°",
    "bandwidth_phase90_without_delay": "−90° alone",
    "bandwidth_3db": "−3 dB",
    "peak_gain_db": "peak",
}
"""Names that fit below a picture."""

_UNITS = {**FIXED_UNITS, "damping_ratio": "–", "scale_factor": "–"}


def montecarlo_page(plan: Plan, found: MonteCarlo) -> StudyPage:
    """Put the page together.

    Parameters
    ----------
    plan : Plan
        What was drawn.
    found : MonteCarlo
        What came of it.
    """
    silent = found.verdicts.get("ok", (0, 0))[1]
    ok = sum(found.verdicts.get("ok", (0, 0)))
    quantities = list(dict.fromkeys(region.quantity for region in found.regions))
    return StudyPage(
        title=plan.name,
        description="",
        headline=(
            f"{found.draws} draws: structure right in {_percent(found.right_structure)}; "
            f"{ok} verdicts ok, {silent} of them wrong."
        ),
        met=None,
        grids=(_parameters(found), _verdicts(found)),
        sections=(
            Section(
                title="Errors and intervals",
                observed="",
                found=(),
                grids=(),
                pictures=(_errors(found), _coverage(found)),
            ),
            *(_by_region(name, found) for name in quantities),
        ),
        facts=(
            ("Seed", str(plan.seed)),
            ("Plan", plan.digest[:16]),
            ("Not identified", "; ".join(found.reasons) or "none"),
            made_by(),
        ),
        upright=not quantities,  # quarters, two pictures side by side, would be too small
    )


def _percent(share: Share) -> str:
    return f"{100 * share.share:.1f}\u00a0% ({100 * share.low:.1f} to {100 * share.high:.1f})"


def _parameters(found: MonteCarlo) -> Grid:
    return Grid(
        caption="Parameters, of draws whose structure was found",
        columns=(
            "Parameter",
            "Draws",
            "R.m.s. error",
            "Over the bound",
            "95 % interval contains truth",
        ),
        rows=tuple(
            (
                axis_label(label_of(score.name), _UNITS.get(score.name, "output unit")),
                str(score.coverage.count),
                f"{score.rms:.4g}",
                f"{score.over_bound:.3f}" if np.isfinite(score.over_bound) else "–",
                _percent(score.coverage),
            )
            for score in found.parameters
        ),
        note="The bound is the Cramér-Rao bound of each draw, for white noise; 1 is the best "
        "possible.",
    )


def _verdicts(found: MonteCarlo) -> Grid:
    return Grid(
        caption="Right and wrong by verdict",
        columns=("Verdict", "Right", "Wrong"),
        rows=tuple((k.replace("_", " "), str(a), str(b)) for k, (a, b) in found.verdicts.items()),
        note=(
            f"Wrong: more than {FAR:g} standard deviations from the truth in any parameter; of "
            "another structure than the true one, in delay, scale factor or bias."
        ),
    )


def _errors(found: MonteCarlo) -> Picture:
    shown = [s for s in found.parameters if np.isfinite(s.over_bound)]
    half = [1.96 * s.over_bound / np.sqrt(2 * max(s.coverage.count, 1)) for s in shown]
    value = np.array([s.over_bound for s in shown])
    return _picture(
        "errors",
        "R.m.s. error over the bound",
        "Each parameter's r.m.s. error over its Cramér-Rao bound, with 95 % intervals.",
        [s.name for s in shown],
        (value, value - half, value + half),
        (1.0, "bound"),
        "Error over bound (–)",
    )


def _coverage(found: MonteCarlo) -> Picture:
    return _picture(
        "coverage",
        "How often the interval contains the truth",
        "Share of draws whose 95 % interval contains the truth.",
        [s.name for s in found.parameters],
        _shares([s.coverage for s in found.parameters]),
        (100 * _STATED, "stated"),
        "Coverage (%)",
    )


def _shares(shares: list[Share]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    told = 100 * np.array([(s.share, s.low, s.high) for s in shares]).reshape(-1, 3)
    return told[:, 0], told[:, 1], told[:, 2]


def _by_region(quantity: str, found: MonteCarlo) -> Section:
    some = [region for region in found.regions if region.quantity == quantity]
    group, _, name = quantity.replace("_", " ").rpartition(".")
    words = f"{name} ({group})" if group else name
    names = [_range(region) for region in some]
    grid = Grid(
        caption=f"Quarters of {words}",
        columns=(
            "From … to", "Over the bound", "95 % interval contains truth", "Structure right", "ok",
            "ok and wrong",
        ),
        rows=tuple(
            (
                name,
                f"{r.over_bound:.3f}" if np.isfinite(r.over_bound) else "–",
                _percent(r.coverage),
                _percent(r.right_structure),
                _percent(r.ok),
                str(r.silent),
            )
            for name, r in zip(names, some, strict=True)
        ),
    )  # fmt: skip
    pictures = (
        _picture(
            f"{quantity}-coverage",
            f"Coverage by {words}",
            "Share of all intervals that contain the truth, by quarter.",
            names,
            _shares([r.coverage for r in some]),
            (100 * _STATED, "stated"),
            "Coverage (%)",
        ),
        _picture(
            f"{quantity}-structure",
            f"Structure right by {words}",
            "Share of draws whose structure is right, by quarter.",
            names,
            _shares([r.right_structure for r in some]),
            None,
            "Structure right (%)",
        ),
    )
    return Section(title=f"By {words}", observed="", found=(), grids=(grid,), pictures=pictures)


def _range(region: Region) -> str:
    return f"{region.low:.3g} … {region.high:.3g}"


def _picture(
    key: str,
    title: str,
    caption: str,
    names: list[str],
    values: tuple[np.ndarray, np.ndarray, np.ndarray],
    wanted: tuple[float, str] | None,
    label: str,
) -> Picture:
    """Points with intervals side by side, and what is wanted as a level line."""
    value, low, high = values
    at = np.arange(len(names), dtype=np.float64)
    ticks = tuple(
        (float(k), _SHORT.get(name, name.replace("_", " "))) for k, name in enumerate(names)
    )
    rule = () if wanted is None else (Rule(at=wanted[0], axis="y", label=wanted[1]),)
    figure = Figure(
        panels=(
            Panel(
                x=Axis(ticks=ticks, low=-0.5, high=len(names) - 0.5, grid=False),
                y=Axis(label=label),
                items=(Points(x=at, y=value, low=low, high=high, size=5.0), *rule),
            ),
        ),
        alt=caption,
        width=max(7.6, 0.95 * len(names)),
    )
    return Picture(key=key, title=title, caption=caption, description=caption, figure=figure)
