"""Figures read off a fitted model, each with its error bar.

readings          every parameter of a fit, and the covariance behind it
figures           what a vector of fitted parameters stands for, with its errors
propagation       how that covariance carries over to what is read off
coefficients      of a system, as results have them
spanned           intervals that cover every model that the record allows
bandwidth         bandwidths of the measured response, beside the model's
sampled_response  what a response is from samples to samples
"""
