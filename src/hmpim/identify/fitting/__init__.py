"""The joint fit: every parameter at once, structure and starting values from the data.

fit             one structure from one start, by least squares
rows, sections  what each linear parameter multiplies; poles in sections
start           starting values: delay and denominator from spectra
joint           all structures, all assumptions between the samples, and the choice
data            what all trials of a joint fit share
candidates      fits of every structure under one assumption
between         the same under each other, from where they ended
enrich          which richer structures to try, and where from
course          the way up to the choice: start, ahead, wander, beginning, enrichment
beginning       which samples count, and whether the record begins at rest
whitening       the noise of all trials, and whether whitening may be trusted
trial           what was tried, and what is chosen of it
plainer         a plain structure beside a rich one
washout         a washout in place of a drift
nested          one pole or two: what the record cannot tell
unrelated       whether an output follows its input at all
halves          whether the halves of a record agree
"""
