"""Several inputs at once: direct terms, couplings, and what cannot be told apart.

inputs      the inputs themselves: bands, condition, copies, coherence
output_fit  one output fitted to all inputs
weak        couplings beside what is strong, one by one
together    all of them moved at once, and their common covariance
lag         where delay and lag are not told apart
responses   the measured response to each input, and what is said of weak ones
"""
