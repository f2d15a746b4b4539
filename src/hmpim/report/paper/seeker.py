"""Fig. 15: a seeker and its tracker, stimulated by a line-of-sight rate."""

from dataclasses import replace

from hmpim.experiment import run
from hmpim.identify import PaperAnalysis, paper_analysis
from hmpim.plots.description import Figure, Item, Rule
from hmpim.report.figures import Picture
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.panels import response_panels
from hmpim.report.paper.rows import Row, agreement
from hmpim.rigs import FunctionRig
from hmpim.rigs.seeker import Seeker
from hmpim.stimulus import Limits, design

__all__ = ["seeker_chapter"]

FS = 1000.0  # Hz, of the simulation and of the record


def seeker_chapter() -> Chapter:
    """Make Fig. 15.

    Examples
    --------
    >>> (row,) = seeker_chapter().rows
    >>> row.paper, round(row.value, 1)
    ('~1.8 Hz', 1.8)
    """
    seeker = Seeker(step=1.0 / FS)
    limits = Limits(position=10.0, unit="deg")
    stimulus = design(band=(0.1, 10.0), duration=20.0, fs=FS, limits=limits, extinction=1.0, lead=0)
    rig = FunctionRig(
        function=seeker,
        mode="sample",
        reset=seeker.reset,
        measures="velocity",
        name="seeker",
        input_name="line-of-sight rate",
        output_name="platform rate command",
    )
    record = run(rig, stimulus)
    analysis = paper_analysis(
        record.inputs[0].values, record.outputs[0].values, FS, band=record.band
    )
    found = analysis.estimates.bandwidth_phase90
    made = (
        f"track loop of gain {seeker.track_gain:g} 1/s, processing delay "
        f"{1e3 * seeker.delay:g} ms, rate loop with time constant {1e3 * seeker.lag:g} ms"
    )
    where = "nowhere" if found is None else f"at {found:.3g} Hz"
    picture = Picture(
        key="fig15",
        title="Example seeker model frequency response",
        caption=f"A model of our own, stepped in time: {made}. Input: the line-of-sight rate of "
        f"a sweep; output: the platform rate command. The phase is −90° {where}, found "
        "automatically.",
        description=f"Magnitude and phase of a seeker; −90° {where}.",
        figure=_figure_15(analysis),
    )
    row = Row(
        figure=15,
        where="Fig. 15",
        quantity="Bandwidth (−90°) of a seeker and tracker",
        paper="~1.8 Hz",
        value=found,
        truth=seeker.bandwidth(),
        unit="Hz",
        why=agreement(
            found,
            1.8,
            within=0.05,
            because="the paper does not describe its seeker; ours is made similar, and the "
            "true figure is its closed form",
        ),
    )
    return Chapter(pictures={15: picture}, rows=(row,))


def _figure_15(analysis: PaperAnalysis) -> Figure:
    magnitude, phase = response_panels(analysis)
    items: list[Item] = [Rule(at=-90.0, axis="y", label="−90°", colour="muted", dashes=":")]
    found = analysis.estimates.bandwidth_phase90
    if found is not None:
        words = f"−90° at {found:.3g} Hz"
        items.append(Rule(at=found, words=words, words_at=0.3, side="left"))
    return Figure(
        panels=(magnitude, replace(phase, items=(*phase.items, *items))),
        alt="Magnitude and phase of a seeker.",
        heights=(2.3, 2.3),
    )
