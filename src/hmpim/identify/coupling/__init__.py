"""Several inputs at once: direct terms, couplings, and what cannot be told apart.

inputs        the inputs themselves: bands, condition, copies, coherence
output_fit    one output fitted to all inputs: which are strong, in turns, and all moved at once
pairs         the fits on the way there: moved at once, simplified, a coupling left out
joint_errors  the error bars, from the derivatives of all
weak          weak couplings one by one; delay and lag where they are not told apart
responses     the measured response to each input, and what is said of weak ones
"""
