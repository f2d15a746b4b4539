"""Several inputs at once: the responses of an output of a simultaneous test to each.

Around each frequency Y = Σ_j G_j U_j + T over neighbouring bins, all inputs together, by
local polynomials and by local rational functions with one denominator:
Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, section 7.3; R. Voorhoeve,
A. van der Maas and T. Oomen, Mech. Syst. Signal Process. 105, 2018. Sweeps that pass a frequency at
different times turn their phases differently from bin to bin there, which separates their
responses. Without this difference no response is given.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Complex, Mask, Real
from hmpim.identify.frf.choice import choose, needs_narrow_windows, picked
from hmpim.identify.frf.columns import Columns
from hmpim.identify.frf.neighbours import (
    Integer,
    LocalFit,
    centres_in_band,
    mirrored,
    windows_around,
)
from hmpim.identify.frf.rational import (
    NUMERATOR,
    TRANSIENT_ORDER,
    RationalSolution,
    RationalState,
    Regressors,
    gauss_newton,
    linear_start,
    read_off,
    solved,
)
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.signals import bins_in, check_band
from hmpim.identify.worth import PART

__all__ = ["JointResponse", "joint_response"]

_ORDER = 2  # of T in polynomial fits
_TERMS = NUMERATOR + 1
# Least singular value, over the greatest, of normalised spectra of different inputs.
_IDENTICAL = 1e-6
_RATIO = 1.6
_STEPS = 3
# Greatest number of frequencies, which are spaced by a constant ratio.
_POINTS = 200
# Bins in all windows of one width, beyond which they cost too much.
_AFFORDABLE = 60_000
# Condition number up to which inputs count as separated: the worst combination then has ten times
# the error of the best.
_WORST = 10.0

# Fewest valid samples of an output.
_FEWEST = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointResponse:
    """Frequency responses of one output to m inputs, measured at once."""

    # of each input, at the frequencies where the inputs can be separated. The coherence is partial:
    # the share of the residual of the others that the input explains, less that of noise
    inputs: tuple[FrequencyResponse, ...]
    frequency: Real  # (f,): Hz
    # (f,): share of the output's power in the window that all inputs together explain, less the
    # share of noise that as many coefficients explain
    multiple_coherence: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Joint:
    """All inputs to one output by one method at one width."""

    own: Regressors
    found: RationalSolution
    local: LocalFit  # of shape (1, c, m)
    moved: Complex  # (w, 1, m, k, q): derivatives of the responses by the coefficients


def joint_response(
    inputs: Real,
    y: Real,
    fs: float,
    *,
    predicted: Real,
    delay: float,
    band: tuple[float, float],
    valid: Mask | None,
    names: Sequence[str],
) -> JointResponse:
    """Return the responses of a model's residual to all inputs of one simultaneous test.

    The inputs, (m, n), are at rest before the record, and each excites the band, in Hz. The output,
    (n,), follows them by a delay in s, not negative; a rough value suffices. It is `predicted`,
    (n,), by a model with its bias, which also takes its place where it is not `valid`, (n,). The
    coherences are those of the output itself. `names` are those of the inputs, then of the output,
    for messages. Inputs that are multiples or sums of others over the whole band are refused, and
    so is a band with too few bins.
    """
    m, samples = inputs.shape
    check_band(band, fs)
    share = _share(valid, names[-1])
    y = y if valid is None else np.where(valid, y, predicted)
    base = int(np.floor(delay * fs + 1e-9))
    step = fs / (samples - base)
    bins = (samples - base - 1) // 2 + 1
    low, high = bins_in(band, step, bins)
    if high - low < 8 * (m + 1):
        raise ArgumentError(
            f"band is ({band[0]:g}, {band[1]:g}) Hz and holds {max(high - low + 1, 0)} bins of "
            f"{step:g} Hz, too few for {m} inputs; give a wider band or a longer record"
        )
    _refuse_identical(inputs, low, high, names[:-1])
    centre = centres_in_band(low, high, _POINTS)
    moved = _moved(inputs, delay * fs, base)
    around = cache(partial(Regressors.around, moved, centre))
    parts = scipy.fft.rfft(np.stack((y - predicted, predicted))[:, base:], axis=1)[:, :bins]
    parts[:, 0] = 0.0
    response, variance, condition, coherence = _chosen(moved, parts, centre, around)
    frequency = centre * step
    usable = np.maximum(_input_condition(moved, centre), condition) <= _WORST
    response = response * np.exp(-2j * np.pi * frequency[:, None] * delay)
    # Filled samples have no residual and add no information: both raise the error.
    std = np.sqrt(variance) / share
    return JointResponse(
        inputs=tuple(
            FrequencyResponse(
                frequency=frequency[usable],
                response=response[usable, j],
                std=std[usable, j],
                coherence=coherence[usable, j],
            )
            for j in range(m)
        ),
        frequency=frequency,
        multiple_coherence=coherence[:, -1],
    )


def _share(valid: Mask | None, name: str) -> float:
    """Share of an output that was measured."""
    if valid is None:
        return 1.0
    if (measured := int(np.count_nonzero(valid))) < _FEWEST:
        raise RecordError(f"{name} has {measured} valid samples; at least {_FEWEST} are needed")
    return float(valid.mean())


def _refuse_identical(u: Real, low: int, high: int, names: Sequence[str]) -> None:
    """Refuse inputs that are multiples or sums of others over the band, and name them."""
    spectra = scipy.fft.rfft(u, axis=1)[:, low : high + 1]
    size = np.sqrt(np.mean(np.abs(spectra) ** 2, axis=1))
    if np.any(size == 0):
        raise RecordError(
            f"{names[int(np.argmin(size))]} has nothing in the band; give a band that it excites"
        )
    spectra = spectra / size[:, None]
    vectors, values, _ = np.linalg.svd(spectra, full_matrices=False)
    if values[-1] > _IDENTICAL * values[0]:
        return
    share = np.abs(vectors[:, -1])
    same = [name for name, s in zip(names, share, strict=True) if s > PART * share.max()]
    raise RecordError(
        f"{', '.join(same)} move alike over the whole band, but for a factor, so their responses "
        "cannot be distinguished; drive them one at a time, or with sweeps that pass each "
        "frequency at different times"
    )


def _input_condition(u: Complex, centre: Integer) -> Real:
    """Condition number of the inputs' spectra around each centre, each scaled to unit power."""
    # A wide window may separate inputs by distant bins only; they must differ nearby too.
    reach = max(int(centre[-1] - centre[0] + 1) // 8, 4 * (u.shape[0] + 1))
    reach = min(reach, u.shape[1] - 1)
    windows = windows_around(centre, u.shape[1], reach)
    block = windows.views(mirrored(u, reach), reach)
    size = np.sqrt(np.maximum(np.sum(np.abs(block) ** 2, axis=2), 1e-300))
    singular = np.linalg.svd(block / size[:, :, None], compute_uv=False)
    ratio = singular[:, 0] / np.maximum(singular[:, -1], 1e-300)
    return np.asarray(ratio)[windows.near]


def _moved(u: Real, late: float, base: int) -> Complex:
    """Transforms of the inputs, delayed by `late` less `base` samples."""
    length = u.shape[1] - base
    count = (length - 1) // 2 + 1
    turn = np.exp(-2j * np.pi * ((late - base) * np.arange(count)) / length)
    spectra: Complex = np.asarray(scipy.fft.rfft(u[:, :length], axis=1))[:, :count] * turn
    spectra[:, 0] = 0.0
    return spectra


def _chosen(
    u: Complex, parts: Complex, centre: Integer, around: Callable[..., Regressors]
) -> tuple[Complex, Real, Real, Real]:
    """Chosen responses and variances, (c, m), condition, (c,), and coherence, (c, m + 1).

    The parts, (2, b), are the transforms of a model's residual, whose responses these are, and of
    its prediction, which the coherence includes. Rational functions are fitted only if the residual
    is not noise: then the polynomials need narrow windows.
    """
    m, residual = u.shape[0], parts[0]
    widths = _widths(centre, u, narrowest=(m + 1) * _TERMS, ratio=_RATIO)
    fits = [fit for width in widths for fit in _fits(around, residual, width, None)]
    best, response, variance = choose([fit.local for fit in fits], [])
    coherence = _of_chosen(fits, best, partial(_coherence, parts))
    if needs_narrow_windows(best, len(widths)).any():
        inside = np.arange(centre[0], centre[-1] + 1)
        smooth = residual.copy()
        smooth[inside] = sum(
            u[j, inside] * np.interp(inside, centre, response[0, :, j]) for j in range(m)
        )
        widths = _widths(centre, u, narrowest=20 + 8 * m, ratio=2.0)
        more = [fit for width in widths for fit in _fits(around, residual, width, smooth)]
        best, response, variance = choose([f.local for f in fits], [f.local for f in more])
        fits += more
    return response[0], variance[0], _of_chosen(fits, best, _condition), coherence


def _of_chosen(
    fits: Sequence[_Joint], best: NDArray[np.int64], read: Callable[[_Joint], Real]
) -> Real:
    """What is read of the fit that is chosen at each centre, (1, c); shape (c, ...)."""
    used, at = np.unique(best[0], return_inverse=True)
    return picked(np.stack([read(fits[k]) for k in used.tolist()]), at)


def _widths(centre: Integer, u: Complex, *, narrowest: int, ratio: float) -> tuple[int, ...]:
    """Return half the band, and less by a constant ratio, if each is affordable."""
    span = int(centre[-1] - centre[0] + 1)
    top = min(span // 2, (u.shape[1] - 2) // 2)
    widths = {top}
    width = float(top)
    while (width := width / ratio) >= narrowest:
        if 2 * width * min(centre.size, 3 * span / width) <= _AFFORDABLE:
            widths.add(round(width))
    return tuple(sorted(widths))


def _fits(
    around: Callable[..., Regressors], y: Complex, width: int, smooth: Complex | None
) -> list[_Joint]:
    """Fit with T and without: rational functions if `smooth` is given to start from."""
    order = _ORDER if smooth is None else TRANSIENT_ORDER
    own = around(width, transient=order)
    outputs = own.views(y[None])
    fits = []
    for columns in (own.both, own.plain):
        with np.errstate(all="ignore"):  # an iterate may diverge; it is then not used
            if smooth is None:
                found = _polynomial(columns, outputs)
            else:
                start = linear_start(columns, own.views(smooth[None]))
                found = gauss_newton(columns, outputs, start, steps=_STEPS)
            local, moved = read_off(own, columns, found, outputs)
        fits.append(_Joint(own=own, found=found, local=local, moved=moved))
    return fits


def _condition(fit: _Joint) -> Real:
    """Condition number of the errors of all inputs' responses at each centre, (c,)."""
    own, m = fit.own, fit.own.power.shape[1]
    slope = own.at_centres(fit.moved.swapaxes(2, 3))[0]
    joint = slope @ fit.found.inverse[own.windows.near, 0] @ np.conj(slope.swapaxes(1, 2))
    failed = np.isinf(fit.local.prediction_error[0]) | ~np.isfinite(joint).all(axis=(1, 2))
    condition = np.linalg.cond(np.where(failed[:, None, None], np.eye(m), joint))
    return np.asarray(np.sqrt(np.maximum(condition, 1.0)))


def _coherence(parts: Complex, fit: _Joint) -> Real:
    """Share of what the output is without an input's columns that they explain, (c, m + 1).

    The fit is by polynomials, which are linear: that of the output is the residual's and that of
    the prediction together. The parts are theirs, (2, b).
    """
    # Adjusted for the number of columns. Without them Σ|residual|² grows by θᴴ V⁻¹ θ of their own.
    own, found, m = fit.own, fit.found, fit.own.power.shape[1]
    y, count = own.views(parts), found.inverse.shape[-1]
    linear = own.both.linear[:, :count]
    predicted = found.inverse[:, 0] @ (np.conj(linear) @ y[:, 1, :, None])
    theta = found.state.theta[:, 0] + predicted[..., 0]
    total = y.sum(axis=1)
    squares = np.maximum(found.state.squares[:, 0], 1e-15 * np.vecdot(total, total).real)
    freedom = np.maximum(own.windows.counted - count, 1)
    blocks = [slice(j * _TERMS, (j + 1) * _TERMS) for j in range(m)]
    out = np.zeros((squares.size, m + 1))
    for k, block in enumerate((*blocks, slice(0, m * _TERMS))):
        part = theta[:, block]
        with np.errstate(all="ignore"):
            against = np.linalg.pinv(found.inverse[:, 0, block, block], hermitian=True)
            grown = np.vecdot(part, (against @ part[..., None])[..., 0]).real
        without = (squares + np.maximum(grown, 0.0)) / (freedom + part.shape[-1])
        out[:, k] = np.clip(1.0 - squares / freedom / without, 0.0, 1.0)
    failed = np.isinf(fit.local.prediction_error[0])
    return np.where(failed[:, None], 0.0, out[own.windows.near])


def _polynomial(columns: Columns, y: Complex) -> RationalSolution:
    """Fit Y = linear columns · coefficients, A = 1, to a record of shape (w, 1, s)."""
    linear = columns.linear[:, None]
    adjoint = np.conj(linear)
    inverse, theta = solved(adjoint @ linear.swapaxes(2, 3), adjoint @ y[..., None])
    fitted = (theta[:, :, None] @ linear)[:, :, 0]
    state = RationalState(
        theta=theta,
        over=np.ones_like(y),
        fitted=fitted,
        residual=y - fitted,
        weight=np.ones(y.shape),
        squares=np.sum(np.abs(y - fitted) ** 2, axis=2),
    )
    return RationalSolution(state=state, before=state, inverse=inverse)
