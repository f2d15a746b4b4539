"""The joint fit: every parameter at once, structure and starting values from the data.

fit             one structure from one start, by least squares
rows, sections  what each linear parameter multiplies; poles in sections
start           starting values: delay and denominator from spectra
joint           all structures, all assumptions between the samples, and the choice
data            what all trials of a joint fit share
candidates      fits of every structure under one assumption
between         refits under the other assumptions
enrich          which richer structures to try, and where from
course          the search before the choice: start, ahead, wander, beginning, enrichment
beginning       which samples count, and whether the record begins at rest
whitening       the noise of all trials
trial           all trials, and the choice among them
plainer         plain structures next to a rich one
unrelated       whether an output follows its input at all
halves          whether the halves of a record agree
"""
