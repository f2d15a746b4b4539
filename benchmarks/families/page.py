"""The section of docs/accuracy.md."""

from __future__ import annotations

from families.catalogue import FAMILIES
from families.study import SEED, run
from families.table import markdown, summary

__all__ = ["section"]

HEAD = """\
What people record, {families} families of it, from a simulator apart from the package: exact poles,
the input known between its samples, nonlinear systems by fine steps. `identify` is told the
samples and the stamps; "stated" families also state the input between the samples.
`python benchmarks/families` makes the table, `--list` says what each family is, `--explain`
shows one draw beside its truth, and `--against benchmarks/families/baseline.json` says what moved
since the first measurement.

- A figure is **wrong** beyond 5 standard deviations (2.5 half-widths of an interval that is not
  symmetric) and 2 % (a delay: 0.05 sample; a bias: 2 % of the output's r.m.s. motion where that is
  more, or less than a hundredth), and a model's response is where it is off by 5 % anywhere the
  record could tell it to 1 %.
- A record **can tell** a figure if the Cramér-Rao deviation of the true structure is below 2 %
  (0.05 sample), the true noise and what drifts or hums included; bandwidths and peaks only inside
  the excited band.
- A figure is **right** only if its interval is at most 3 times the bound's. Where held, linear and
  band-limited inputs explain the record alike (log-likelihoods within 6), 3 times the hull of the
  figures under each of them, and each of their responses is accepted. No interval need be narrower
  than a tenth of what is never wrong.
- A draw is wrong if any figure or the response is, `ok` if that figure's verdict is (the pair's, of
  a response); else it is right if a figure that the record can tell is right. No answer: refused,
  not identifiable, crashed, or nothing right given. What a draw leaves out counts in the columns
  of figures. † marks families of which a fifth of the intervals span such a hull: they need 93 %
  and may cover more than 97 %.
- ✗ marks a rate of wrong & `ok` whose 95 % lower bound (Clopper and Pearson, one-sided) exceeds
  2 %, and coverage that an exact binomial test rejects at 5 % over the number of families. Figures
  of one record err together, so the test is severer than its level: a family that fails it is
  drawn again, 400 times (`--families NAME --draws 400 --seed 2`).
- Measured off: draws whose measured response lies beyond 5 % and 5 standard deviations at more than
  a twentieth of its points; of a held input, the response from samples to samples counts as true
  as well.

Right means, where it is not plain: a clipped, rounded, drifting or noisy record has the linear
system's figures, the bias being its mean over the record. Slew, dead zone, backlash, friction and
springs need not be told, and what is called `ok` must be the linear part's. A plant in a loop is
the plant; read without its reference under a slow disturbance it is biased and need not be told.
Software has z's figures: the delay in whole samples, and the response from samples to samples. An
output beside an unrelated input must be called not identifiable. Scale factor and what refers
to DC are not asked of a system that is zero there; the natural frequency not where two modes lie
within a third of each other.

**A family more**: a line in `benchmarks/families/catalogue.py` joins a system and an input of
`kinds.py`, both drawn at random, with conditions of `conditions.py`, each a function that changes
the record and says what it leaves to be told. What is not one linear system under an input goes to
`made.py`. The draw follows from the family's name, the seed and its number alone.
"""


def section(draws: int, *, jobs: int, every: int = 1) -> list[str]:
    """The text and the table; `every` takes only one in so many families."""
    names = list(FAMILIES)[::every]
    scores = run(names, draws=draws, jobs=jobs)
    rows = {name: summary(found) for name, found in scores.items()}
    less = sorted({f"{f.name}: {f.most}" for f in FAMILIES.values() if 0 < f.most < draws})
    note = f"Seed {SEED}; {draws} draws of each" + (f" ({'; '.join(less)})" if less else "") + "."
    return [*HEAD.format(families=len(FAMILIES)).splitlines(), "", note, "", *markdown(rows)]
