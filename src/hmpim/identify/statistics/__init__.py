"""Statistics: a record compressed to what identification needs, additive, block by block.

reach       the lags that are kept, and the rows of the bias
run         one run: products of its samples, and its two ends
statistics  runs of one input and one output: compress, update, join
products    products of filtered signals over the samples that count
start       a response without a model, from which the starts are found
fit         one structure, by the optimiser of the joint fit, and its residual
misfit      whether the residual follows the input; one more pole
beyond      nonlinearity and held outputs
limits      cases that statistics cannot distinguish
choose      the search of the joint fit, with products in place of samples
describe    the result for the pair
live        the estimate so far, while samples arrive
"""

from hmpim.identify.statistics.live import LiveEstimator, Look
from hmpim.identify.statistics.statistics import Statistics, compress

__all__ = ["LiveEstimator", "Look", "Statistics", "compress"]
