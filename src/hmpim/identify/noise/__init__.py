"""The noise: the part of the output that does not depend on any input.

whiteness       whether it is white, and how many of its samples are independent
autoregression  the filter that whitens it, and its spectrum
covariance      the covariance of a fit under it
level           its level along the record
misfit          whether a residual is noise at all, or still follows the input
spectra         spectra of an input, shared by several steps
colour          its kind in words: correlated, low-frequency, a line; and whether the bias drifts
input_noise     noise on the input itself
"""
