"""Several inputs at once: direct terms, couplings, and what cannot be told apart.

inputs      the inputs themselves: bands, condition, copies, coherence
output_fit  one output fitted to all inputs, all moved at once, with their common covariance
weak        couplings beside what is strong, one by one; delay and lag where they are not told apart
responses   the measured response to each input, and what is said of weak ones
"""
