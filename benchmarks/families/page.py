"""The section of docs/accuracy.md."""

from __future__ import annotations

from families.catalogue import FAMILIES
from families.study import SEED, run
from families.table import markdown, summary

__all__ = ["section"]

HEAD = """\
The study simulates the records that people make: {families} families, eleven of them with several
inputs. The simulator is independent of the package: exact poles, an input that is known between its
samples, and nonlinear systems integrated in fine steps. `identify` is given the samples and the
stamps. In "stated" families it is also given the behaviour of the input between the samples, and
in families of software under noise that the unit is software. `python benchmarks/families` makes
the table, `--list` describes each family, `--explain` compares one draw with its truth, and
`--against benchmarks/families/baseline.json` lists what has changed since the first measurement.

- A figure is **wrong** if its error exceeds both 5 standard deviations (2.5 half-widths of an
  interval that is not symmetric) and 2 % (a delay: 0.05 sample; a bias: 2 % of the output's r.m.s.
  motion, if that motion is larger than the bias or less than a hundredth of it). A model's
  response is wrong if it is off by 5 % at any frequency at which the record determines it to 1 %.
- A record **determines** a figure if the Cramér-Rao deviation for the true structure is below 2 %
  (0.05 sample), given the true noise, drift and hum; bandwidths and peaks only inside the excited
  band. The table calls this "can tell".
- A figure is **right** only if its interval is at most 3 times as wide as the bound's. If held,
  linear and band-limited inputs explain the record equally well (log-likelihoods within 6), 3 times
  the hull of the figures under each assumption is allowed, and the response under each is accepted.
  An interval as narrow as a tenth of the tolerance for wrong figures is always narrow enough.
- A draw is wrong if a figure or the response is wrong; it is wrong and `ok` if the verdict of that
  figure (for a response: of the pair) is `ok`. Otherwise it is right if at least one determined
  figure is right. It has no answer if it was refused, not identifiable or crashed, or if no figure
  was right. Figures that a draw does not give count in the columns of figures. † marks families in
  which a fifth of the intervals span such a hull: they need 93 % and may cover more than 97 %.
- ✗ marks two things: a rate of wrong & `ok` whose 95 % lower bound (Clopper and Pearson, one-sided)
  exceeds 2 %, and a coverage that an exact binomial test rejects at 5 % over the number of
  families. The errors of one record's figures are correlated, so the test is stricter than its
  level: a family that fails it is drawn again, 400 times (`--families NAME --draws 400 --seed 2`).
- Measured off: draws whose measured response is off by more than 5 % and 5 standard deviations at
  more than a twentieth of its points. For a held or linear input, the response from samples to
  samples counts as true as well.

What "right" means in special cases: the true figures of a clipped, rounded, drifting or noisy
record are those of the linear system, and its bias is the mean over the record. A slew limit, dead
zone, backlash, friction or spring need not be recognised, but figures called `ok` must be those of
the linear part. For a plant in a loop, the figures are the plant's; without the reference and under
a slow disturbance the estimate is biased, and no right figure is required. Software has the
figures of its filter in z: the delay in whole samples, and the response from samples to samples. An
output unrelated to its input must be called not identifiable. A system whose gain is zero at DC is
not scored on its scale factor or on figures that refer to DC, nor one with two modes within a third
of each other on its natural frequency.

**To add a family**, add a line to `benchmarks/families/catalogue.py`. It joins a system and an
input of `kinds.py`, both drawn at random, with conditions of `conditions.py`. Each condition is a
function that changes the record and states which figures it leaves identifiable. Records that are
not one linear system under one input belong in `made.py`. A draw depends on the family's name, the
seed and its number only.
"""


def section(draws: int, *, jobs: int, every: int = 1) -> list[str]:
    """The text and the table; `every` takes only one in so many families."""
    names = list(FAMILIES)[::every]
    scores = run(names, draws=draws, jobs=jobs)
    rows = {name: summary(found) for name, found in scores.items()}
    less = sorted({f"{f.name}: {f.most}" for f in FAMILIES.values() if 0 < f.most < draws})
    note = f"Seed {SEED}; {draws} draws of each" + (f" ({'; '.join(less)})" if less else "") + "."
    return [*HEAD.format(families=len(FAMILIES)).splitlines(), "", note, "", *markdown(rows)]
