"""Several inputs and outputs: direct terms, couplings, and what cannot be told apart.

inputs      the inputs themselves: bands, condition, copies, coherence
several     one output fitted to all inputs
couplings   the weak ones, one by one
jointly     all of them moved together
lag         where delay and lag are not told apart
coupled     the matrix of responses, refusals and warnings
"""
