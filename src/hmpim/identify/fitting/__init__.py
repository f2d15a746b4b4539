"""The joint fit: every parameter at once, structure and starting values from the data.

fit           one structure from one start, by least squares
start         starting values: delay and denominator from spectra
joint         all structures, all assumptions between the samples, and the choice
enrich        the richer structures
unexplained   what of the response a fit leaves over
plainer       a plain structure beside a rich one
nested        one pole or two: what the record cannot tell
unrelated     whether an output follows its input at all
halves        whether the halves of a record agree
"""
