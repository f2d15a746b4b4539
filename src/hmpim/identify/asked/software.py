"""Whether a record is that of software, which sees samples and nothing between them."""

from dataclasses import replace
from typing import cast

import numpy as np

from hmpim.identify.asked.question import Question
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.software import is_exact, software_fit
from hmpim.identify.worth import ROUNDING
from hmpim.model.dynamics import FILTERS, StructureName

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
    plain = [trial.fit for trial in joint_fit(u, y, structures=PLAIN).trials]
    exact = [fit.structure.parameters for fit in plain if fit.cost <= enough]
    if filters.cost > enough or filters.structure.parameters > min(exact, default=np.inf):
        return question
    names = cast(tuple[StructureName, ...], tuple(FILTERS))
    return replace(question, intersample="sampled", structures=names, exact=True)
