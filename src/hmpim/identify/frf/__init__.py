"""The frequency response, with its error at each frequency.

local           one record: local polynomials and rational functions, chosen by the data
neighbours, polynomial, columns, rational, choice   the parts of it
multivariable   several inputs at once
"""
