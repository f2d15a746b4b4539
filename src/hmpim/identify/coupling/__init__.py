"""Several inputs at once: direct terms, couplings, and which inputs one record distinguishes.

inputs        the inputs alone: bands, condition, copies, coherence
output_fit    one output fitted to all inputs: the strong ones, in turns, then all at once
pairs         the state of that search: fits moved at once, simplified, couplings dropped
joint_errors  error bars from the derivatives of all pairs
weak          weak couplings one by one
residual      whether the residual still follows an input
responses     measured response to each input, and findings on weak couplings
"""
