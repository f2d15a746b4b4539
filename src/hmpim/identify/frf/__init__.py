"""The frequency response, with its error at each frequency.

local           one record: local polynomials and rational functions, chosen by cross-validation
neighbours      transforms, and windows of their bins
polynomial      local polynomials
rational        local rational functions, and `columns`, their regressors
choice          the choice between these fits
multivariable   several inputs at once
"""
