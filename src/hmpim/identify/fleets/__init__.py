"""Many records of one stimulus, fitted together by what they share.

learnt   what the first records determine: the box that contains the units, and a surface of models
surface  smooth functions on a box as polynomials
fits     all records fitted at once, in a few numbers each
pole     one more pole for single records
simpler  simpler structures, fitted to all records
fleet    from outputs to figures, with intervals as `identify` gives them
quiet    the tests that `identify` makes, for all records at once
whole    the whole result of `identify`, for the records that pass
"""
