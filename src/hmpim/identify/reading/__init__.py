"""Figures read off a fitted model, each with its error bar.

readings    every parameter of a fit, and their covariance
figures     figures of a vector of fitted parameters, with their errors
spanned     intervals that cover every model that the record allows
bandwidth   bandwidths of the measured response, compared with the model's
"""
