"""The noise: one room for all that is said of what no input moves.

whiteness       whether it is white, and how many of its samples are independent
autoregression  its past foretells it: the filter that whitens it, and its spectrum
covariance      the error bars that a fit has under it
misfit          whether it is noise at all, or still follows the input
colour          its kind in words: correlated, rumbling, a line; and whether the bias drifts
input_noise     noise on the input itself
"""
