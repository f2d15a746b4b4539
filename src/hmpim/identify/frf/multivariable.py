"""Several inputs at once: every response of a simultaneous test, direct and coupling.

Around each frequency Y_i = Σ_j G_ij U_j + T_i over neighbouring bins, all inputs together, by
local polynomials and by local rational functions with one denominator for each output:
Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, section 7.3; R. Voorhoeve,
A. van der Maas and T. Oomen, Mech. Syst. Signal Process. 105, 2018. Sweeps that pass a frequency at
different times turn their phases differently from bin to bin there, which separates their
responses. Without this difference no response is given.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Complex, Mask, Real
from hmpim.identify.frf.choice import choose, picked
from hmpim.identify.frf.columns import Columns
from hmpim.identify.frf.neighbours import LocalFit, centres_in_band, mirrored, windows_around
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
from hmpim.identify.signals import as_signal, bins_in, check_band, check_rate
from hmpim.identify.worth import PART

__all__ = ["ResponseMatrix", "response_matrix"]

_ORDER = 2  # of T in polynomial fits
_TERMS = NUMERATOR + 1
# Least singular value, over the greatest, of normalised spectra of different inputs.
_IDENTICAL = 1e-6
_RATIO = 1.6
_STEPS = 3
# Bins in all windows of one width, beyond which they cost too much.
_AFFORDABLE = 60_000
# Fewest valid samples of an output.
_FEWEST = 16

Integer = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResponseMatrix:
    """Frequency responses from every input to every output, measured at once.

    Parameters
    ----------
    frequency : ndarray, shape (f,)
        Hz.
    response : complex ndarray, shape (f, p, m)
        Output i over input j, delay included; NaN where not `usable`.
    std : ndarray, shape (f, p, m)
        √E|error|²; NaN where not `usable`.
    condition : ndarray, shape (f,)
        Condition number of the inputs' spectra over a quarter of the band around, or, if that is
        larger, of the error of the responses there: 1 for inputs that have nothing in common,
        infinite for identical ones. Inputs are scaled to their own power.
    usable : bool ndarray, shape (f,)
        Whether the inputs can be separated.
    multiple_coherence : ndarray, shape (f, p)
        Share of the output's power in the window that all inputs together explain, less the share
        of noise that as many coefficients explain.
    partial_coherence : ndarray, shape (f, p, m)
        Share that one input explains of the residual of the others, likewise.
    inputs, outputs : tuple of str
        Names.
    """

    frequency: Real
    response: Complex
    std: Real
    condition: Real
    usable: Mask
    multiple_coherence: Real
    partial_coherence: Real
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Joint:
    """All inputs to one output by one method at one width."""

    local: LocalFit  # of shape (1, c, m)
    condition: Real  # (1, c)
    coherence: Real  # (1, c, m + 1)


def response_matrix(
    inputs: ArrayLike,
    outputs: ArrayLike,
    fs: float,
    *,
    delays: ArrayLike = 0.0,
    band: tuple[float, float],
    valid: ArrayLike | None = None,
    fill: ArrayLike | None = None,
    worst_condition: float = 10.0,
    points: int = 400,
    names: Sequence[str] | None = None,
) -> ResponseMatrix:
    """Return the responses of all outputs to all inputs of one simultaneous test.

    Parameters
    ----------
    inputs : array_like, shape (m, n)
        Stimuli on one clock, at rest before the record.
    outputs : array_like, shape (p, n)
        Responses.
    fs : float
        Sampling rate, Hz.
    delays : array_like, shape (p, m), (p, 1) or ()
        Pure delays in s, output over input, not negative; rough values suffice.
    band : tuple of float
        Band that every input excites, Hz.
    valid : array_like of bool, shape (p, n) or (n,), optional
        False where an output is missing; all samples are valid by default.
    fill : array_like, shape (p, n), optional
        A model's prediction of the outputs, bias included, used where they are missing. By default
        a smooth curve through the neighbours, for gaps that are short compared with a period.
    worst_condition : float
        Greatest condition number at which inputs count as separated, above 1. At 10 the error of
        the worst combination of inputs is ten times that of the best.
    points : int
        Greatest number of frequencies; beyond it they are spaced by a constant ratio.
    names : sequence of str, optional
        Of the inputs, then of the outputs; "input 0" and so on by default.

    Raises
    ------
    RecordError
        For shapes that do not fit, NaN, a constant input, or inputs that are multiples or sums of
        others over the whole band: they are named.
    ArgumentError
        For an impossible rate, band, delay, bound or names.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> up = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> u = np.stack((up, up[::-1]))
    >>> y = np.array([[1.0, 0.05], [-0.05, 2.0]]) @ u
    >>> found = response_matrix(u, y, 200.0, band=(0.5, 20.0))
    >>> bool(np.nanmax(np.abs(found.response[:, 0, 1] - 0.05)) < 1e-4)
    True
    >>> bool(found.usable.all())
    True
    """
    u, y = _checked_signals("inputs", inputs), _checked_signals("outputs", outputs)
    m, p = u.shape[0], y.shape[0]
    if u.shape[1] != y.shape[1]:
        raise RecordError(
            f"inputs have {u.shape[1]} samples and outputs {y.shape[1]}; cut them to the same span"
        )
    check_rate(fs)
    check_band(band, fs)
    numbered = [*(f"input {k}" for k in range(m)), *(f"output {k}" for k in range(p))]
    labels = tuple(numbered if names is None else names)
    if len(labels) != m + p:
        raise ArgumentError(f"names holds {len(labels)}; give {m} of inputs and {p} of outputs")
    labels_u, labels_y = labels[:m], labels[m:]
    late = _checked_delays(delays, p, m, u.shape[1] / fs)
    if not worst_condition > 1:
        raise ArgumentError(f"worst_condition is {worst_condition}; give a number above 1")
    if points < 1:
        raise ArgumentError(f"points is {points}; give at least 1")
    y, share = _filled(y, valid, fill, labels_y)
    for row, label in zip(u, labels_u, strict=True):
        if np.ptp(row) == 0:
            raise RecordError(f"{label} is constant at {row[0]:g}; an input must move")
    base = int(np.floor(late.min() * fs + 1e-9))
    step = fs / (u.shape[1] - base)
    bins = (u.shape[1] - base - 1) // 2 + 1
    low, high = bins_in(band, step, bins)
    if high - low < 8 * (m + 1):
        raise ArgumentError(
            f"band is ({band[0]:g}, {band[1]:g}) Hz and holds {max(high - low + 1, 0)} bins of "
            f"{step:g} Hz, too few for {m} inputs; give a wider band or a longer record"
        )
    _refuse_identical(u, low, high, labels_u)
    centre = centres_in_band(low, high, points)
    each = [_chosen(_moved(u, row, fs, base), y[i], base, centre) for i, row in enumerate(late)]
    response, variance, conditions, coherence = (
        np.stack(parts, axis=1) for parts in zip(*each, strict=True)
    )
    frequency = centre * step
    inputs_alone = _input_condition(_moved(u, late[0], fs, base), centre)
    condition = np.maximum(inputs_alone, conditions.max(axis=1))
    usable = condition <= worst_condition
    response = response * np.exp(-2j * np.pi * frequency[:, None, None] * late)
    # Filled samples have no residual and add no information: both raise the error.
    std = np.sqrt(variance) / share[:, None]
    response[~usable] = complex(np.nan, np.nan)
    std[~usable] = np.nan
    return ResponseMatrix(
        frequency=frequency,
        response=response,
        std=std,
        condition=condition,
        usable=usable,
        multiple_coherence=coherence[:, :, -1],
        partial_coherence=coherence[:, :, :-1],
        inputs=labels_u,
        outputs=labels_y,
    )


def _filled(
    y: Real, valid: ArrayLike | None, fill: ArrayLike | None, labels: tuple[str, ...]
) -> tuple[Real, Real]:
    """Outputs with their gaps filled, (p, n), and the share of each that was measured, (p,)."""
    if valid is None:
        return y, np.ones(y.shape[0])
    mask = np.asarray(valid)
    if mask.dtype != np.bool_ or mask.shape not in (y.shape, y.shape[1:]):
        raise ArgumentError(
            f"valid has shape {mask.shape} and type {mask.dtype}; give booleans of shape {y.shape} "
            f"or ({y.shape[1]},)"
        )
    mask = np.broadcast_to(mask, y.shape)
    given = None if fill is None else np.asarray(fill, dtype=np.float64)
    if given is not None and given.shape != y.shape:
        raise RecordError(f"fill has shape {given.shape} and outputs {y.shape}; give as many")
    out = y.copy()
    for i, (row, counts, label) in enumerate(zip(out, mask, labels, strict=True)):
        measured, gaps = np.flatnonzero(counts), np.flatnonzero(~counts)
        if measured.size < _FEWEST:
            raise RecordError(
                f"{label} has {measured.size} valid samples; at least {_FEWEST} are needed"
            )
        if given is not None:
            row[gaps] = given[i, gaps]
        elif gaps.size:
            row[gaps] = scipy.interpolate.PchipInterpolator(measured, row[measured])(gaps)
    return out, np.asarray(mask.mean(axis=1))


def _checked_signals(name: str, values: ArrayLike) -> Real:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[0] < 1:
        raise RecordError(f"{name} has shape {array.shape}; give one row for each channel, (m, n)")
    for k, row in enumerate(array):
        as_signal(f"{name}[{k}]", row)
    return array


def _checked_delays(delays: ArrayLike, p: int, m: int, length: float) -> Real:
    late = np.asarray(delays, dtype=np.float64)
    try:
        late = np.broadcast_to(late, (p, m))
    except ValueError:
        raise ArgumentError(
            f"delays has shape {late.shape}; give ({p}, {m}), output over input"
        ) from None
    wrong = late[~((late >= 0) & (late < length / 2))]
    if wrong.size:
        raise ArgumentError(
            f"delays holds {wrong[0]} s; give 0 or more, and less than half the record"
        )
    return np.asarray(late)


def _refuse_identical(u: Real, low: int, high: int, labels: tuple[str, ...]) -> None:
    """Refuse inputs that are multiples or sums of others over the band, and name them."""
    spectra = scipy.fft.rfft(u, axis=1)[:, low : high + 1]
    size = np.sqrt(np.mean(np.abs(spectra) ** 2, axis=1))
    if np.any(size == 0):
        raise RecordError(
            f"{labels[int(np.argmin(size))]} has nothing in the band; give a band that it excites"
        )
    spectra = spectra / size[:, None]
    vectors, values, _ = np.linalg.svd(spectra, full_matrices=False)
    if values[-1] > _IDENTICAL * values[0]:
        return
    share = np.abs(vectors[:, -1])
    same = [label for label, s in zip(labels, share, strict=True) if s > PART * share.max()]
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


def _moved(u: Real, late: Real, fs: float, base: int) -> Complex:
    """Transforms of the inputs, each delayed as its response is, less `base` samples."""
    length = u.shape[1] - base
    moved = np.empty((u.shape[0], length))
    rest = np.empty(late.size)
    for j, row in enumerate(u):
        lag = int(np.floor(late[j] * fs + 1e-9)) - base
        moved[j, lag:] = row[: length - lag]
        moved[j, :lag] = row[0]  # an input is at rest before the record
        rest[j] = late[j] * fs - (lag + base)
    count = (length - 1) // 2 + 1
    turn = np.exp(-2j * np.pi * np.outer(rest, np.arange(count)) / length)
    spectra: Complex = np.asarray(scipy.fft.rfft(moved, axis=1))[:, :count] * turn
    spectra[:, 0] = 0.0
    return spectra


def _chosen(u: Complex, y: Real, base: int, centre: Integer) -> tuple[Complex, Real, Real, Real]:
    """Chosen responses and variances, (c, m), condition, (c,), and coherence, (c, m + 1)."""
    spectrum = np.array(scipy.fft.rfft(y[base:]))[: u.shape[1]]
    spectrum[0] = 0.0
    widths = _widths(centre, u, narrowest=(u.shape[0] + 1) * _TERMS, ratio=_RATIO)
    polynomials = [fit for width in widths for fit in _fits(u, spectrum, centre, width, None)]
    _, (g,), _ = choose([fit.local for fit in polynomials], [])
    inside = np.arange(centre[0], centre[-1] + 1)
    smooth = spectrum.copy()
    smooth[inside] = sum(
        u[j, inside] * np.interp(inside, centre, g[:, j]) for j in range(u.shape[0])
    )
    widths = _widths(centre, u, narrowest=20 + 8 * u.shape[0], ratio=2.0)
    rationals = [fit for width in widths for fit in _fits(u, spectrum, centre, width, smooth)]
    local = [[fit.local for fit in fits] for fits in (polynomials, rationals)]
    best, response, variance = choose(*local)
    tried = (*polynomials, *rationals)
    condition = picked(np.stack([fit.condition for fit in tried]), best)[0]
    coherence = picked(np.stack([fit.coherence for fit in tried]), best)[0]
    return response[0], variance[0], condition, coherence


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
    u: Complex, y: Complex, centre: Integer, width: int, smooth: Complex | None
) -> list[_Joint]:
    """Fit with T and without: rational functions if `smooth` is given to start from."""
    order = _ORDER if smooth is None else TRANSIENT_ORDER
    own = Regressors.around(u, centre, width, transient=order)
    outputs = own.views(y[None])
    found = []
    for columns in (own.both, own.plain):
        if smooth is None:
            found.append(_joint(own, columns, _polynomial(columns, outputs), outputs))
            continue
        with np.errstate(all="ignore"):  # an iterate may diverge; it is then not used
            start = linear_start(columns, own.views(smooth[None]))
            solution = gauss_newton(columns, outputs, start, steps=_STEPS)
            found.append(_joint(own, columns, solution, outputs))
    return found


def _joint(own: Regressors, columns: Columns, found: RationalSolution, y: Complex) -> _Joint:
    """Responses, condition and coherence at each centre from one fit over each window."""
    m, near = own.power.shape[1], own.windows.near
    local, moved = read_off(own, columns, found, y)
    slope = own.at_centres(moved.swapaxes(2, 3))
    joint = slope @ found.inverse[near].swapaxes(0, 1) @ np.conj(slope.swapaxes(2, 3))
    failed = np.isinf(local.prediction_error) | ~np.isfinite(joint).all(axis=(2, 3))
    condition = np.linalg.cond(np.where(failed[..., None, None], np.eye(m), joint))
    coherence = _coherence(own, found, np.vecdot(y, y).real)[near].swapaxes(0, 1)
    return _Joint(
        local=local,
        condition=np.sqrt(np.maximum(condition, 1.0)),
        coherence=np.where(failed[..., None], 0.0, coherence),
    )


def _coherence(own: Regressors, found: RationalSolution, total: Real) -> Real:
    """Share of the residual without an input's columns that they explain, (w, r, m + 1)."""
    # Adjusted for the number of columns. Without them Σ|residual|² grows by θᴴ V⁻¹ θ of their own.
    m = own.power.shape[1]
    squares = np.maximum(found.state.squares, 1e-15 * total)
    freedom = np.maximum(own.windows.counted - found.inverse.shape[-1], 1)[:, None]
    blocks = [slice(j * _TERMS, (j + 1) * _TERMS) for j in range(m)]
    out = np.zeros((*squares.shape, m + 1))
    for k, block in enumerate((*blocks, slice(0, m * _TERMS))):
        part = found.state.theta[..., block]
        with np.errstate(all="ignore"):
            against = np.linalg.pinv(found.inverse[..., block, block], hermitian=True)
            grown = np.vecdot(part, (against @ part[..., None])[..., 0]).real
        without = (squares + np.maximum(grown, 0.0)) / (freedom + part.shape[-1])
        out[..., k] = np.clip(1.0 - squares / freedom / without, 0.0, 1.0)
    return out


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
