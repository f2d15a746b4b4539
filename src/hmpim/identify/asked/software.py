"""Whether a record is that of software, which sees samples and nothing between them."""

from dataclasses import replace
from typing import cast

import numpy as np

from hmpim.identify.asked.question import Question
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.software import is_exact, software_fit
from hmpim.identify.worth import ROUNDING
from hmpim.model.dynamics import FILTERS, STRUCTURES, StructureName

__all__ = ["recognise_software"]


def recognise_software(question: Question) -> Question:
    """Ask for filters where rounding is all the noise, and no plainer system explains the record.

    Of one input whose samples are all there, and of which nothing is stated.
    """
    source, output = question.aligned.inputs[0], question.output
    if question.intersample is not None or question.swapped or question.instrument:
        return question
    if question.inputs or not (source.valid.all() and output.valid.all()):
        return question
    u, y = source.values, output.values
    if not is_exact(u, y):
        return question
    filters = software_fit(u, y).best.fit
    enough = ROUNDING**2 * float(np.sum((y - y.mean()) ** 2))
    if filters.cost > enough:
        return question
    fewest = filters.structure.parameters
    plainer = tuple(name for name in PLAIN if STRUCTURES[name].parameters < fewest)
    if plainer and any(
        trial.fit.cost <= enough and trial.fit.structure.parameters < fewest
        for trial in joint_fit(u, y, structures=plainer).trials
    ):
        return question
    names = cast(tuple[StructureName, ...], tuple(FILTERS))
    return replace(question, intersample="sampled", structures=names, exact=True)
