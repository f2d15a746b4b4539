"""Uses of a result.

predict     a model from it, and its output for another record
validate    the model tested on another record
compare     two results of one unit: changes beyond the error bars
gain_phase  gain and phase at any frequency
gains       the unit of a scale factor
nonlinear   the nonlinear part of a model under another input
"""
