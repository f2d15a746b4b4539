r"""The gentlest multisine: every amplitude and phase free, solved by linear programmes.

The lines are harmonics, and three linear conditions, sums over the lines, put position,
velocity and acceleration at 0 where a period begins; so the motion starts and ends at rest,
and needs no lead but one sample at rest on either side. Over a long record a shorter period
is repeated.

With acceleration amplitudes z (cosine and sine parts of each line) the motion is linear in
z and the information quadratic. Around a point, log(standard deviation / wanted) is
linearised, with the derivative from d(M⁻¹) = -M⁻¹ dM M⁻¹; peaks, sampled densely, are linear
constraints as they stand. So each step is a linear programme within a trust region that
grows where a step was good and shrinks where it was not (R. Fletcher, Practical Methods of
Optimization, 2nd ed., 1987, section 14.4).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.optimal.candidate import Candidate, gentler, try_out
from hmpim.optimal.fisher import sensitivities
from hmpim.optimal.wish import PARAMETERS, Step, Wish
from hmpim.stimulus import RestToRest, SumOfSines
from hmpim.stimulus.quintic import Quintic

__all__ = ["best_multisine", "multisine_lines"]

FloatArray = NDArray[np.float64]

_LINES = 24  # that many at most: enough freedom, and each programme solves in hundredths of a s
_REACH = 2.0  # highest line, over the highest natural frequency
_POINTS = 24  # per cycle of the highest line, at which peaks are held
_INSIDE = 0.995  # of the limits, for what those points cannot see
_PATIENCE = 5  # good steps
_LITTLE = 2e-3  # of the cost: less gained in so many steps ends a descent
_FIRST_ROWS = 4  # per unknown, that a linear programme is begun with
_BROKEN = 1e-9  # of a bound: what a solution may exceed it by
_END = 0.36  # of the greatest velocity of a line, which one past the reach must have
_FEWEST = 4  # lines that leave freedom beside the three conditions of rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Programme:
    """What the linear programmes are made of; all in acceleration amplitudes z, shape (2m,)."""

    wish: Wish
    information: tuple[FloatArray, ...]  # each (4, 4, 2m, 2m): quadratic in z, one per model
    wanted: tuple[FloatArray, ...]  # standard deviations, each (4,)
    motion: FloatArray  # (4, points, 2m): position, velocity, acceleration, jerk
    rest: FloatArray  # (3, 2m)
    bounds: FloatArray  # (4,) of the motion
    moving: float  # share of the record in which it moves
    omega: FloatArray  # of the lines, rad/s, shape (m,)
    edge: bool = False  # whether the end of the band seen counts

    def log_ratios(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return log(std / wanted) of each parameter of each model, and its slope by z."""
        values, slopes = [], []
        for matrix, wanted in zip(self.information, self.wanted, strict=True):
            applied = matrix @ z  # (4, 4, 2m)
            inverse = np.linalg.pinv(applied @ z, hermitian=True)
            variance = np.diag(inverse)
            values.append(0.5 * np.log(variance) - np.log(wanted))
            slope = np.tensordot(inverse, applied, axes=(0, 0))  # (p, 4, 2m)
            slope = np.einsum("pb,pbi->pi", inverse, slope)
            slopes.append(-slope / variance[:, None])
        return np.concatenate(values), np.concatenate(slopes)

    def cost(self, z: FloatArray) -> float:
        """What is to be small at the size that buys the accuracy, dearer beyond the limits."""
        gain = math.exp(float(self.log_ratios(z)[0].max()))
        peaks = np.abs(self.motion @ z).max(axis=1) * gain
        use = peaks / self.bounds
        short = max(self._edge(z)[0], 1.0) ** 3 if self.edge else 1.0
        if self.wish.gentle == "duration":
            return float(use.max()) * short
        beyond = max(float(use.max()), 1.0) ** 3
        return gain * self._size(z)[0] * beyond * short

    def _edge(self, z: FloatArray) -> tuple[float, int]:
        """What the strongest line past the reach lacks of what ends a band, and its number.

        The band seen in samples ends where the velocity's spectrum falls below a quarter.
        """
        velocity = np.hypot(*z.reshape(2, -1)) / self.omega
        past = np.flatnonzero(self.omega >= 2.0 * np.pi * self.wish.reach)
        if past.size == 0:
            return math.inf, -1
        best = int(past[np.argmax(velocity[past])])
        return _END * float(velocity.max()) / max(float(velocity[best]), 1e-300), best

    def _size(self, z: FloatArray) -> tuple[float, FloatArray]:
        """What is to be small, and its slope by z."""
        gentle = self.wish.gentle
        if gentle == "rms_acceleration":
            size = math.sqrt(0.5 * self.moving * float(z @ z))
            return size, 0.5 * self.moving * z / size
        if gentle == "travel":
            velocity = self.motion[1] @ z
            slope = np.sign(velocity) @ self.motion[1] / velocity.size
            return float(np.abs(velocity).mean()), slope
        values = np.abs(self.motion[2] @ z)
        return float(values.max()), np.zeros(z.size)

    def step(self, z: FloatArray, trust: float) -> FloatArray | None:
        """Solve the linear programme around `z`, whose size buys the accuracy."""
        values, slopes = self.log_ratios(z)
        near = values > -2.0 * trust - 0.1
        count = z.size
        shares = np.abs(self.motion @ z).max(axis=1) / self.bounds
        rows, right = [np.column_stack([slopes[near], np.zeros(near.sum())])], []
        right.append(slopes[near] @ z - values[near])
        for order, matrix in enumerate(self.motion):
            bound = float(self.bounds[order])
            free = 0.0  # weight of the programme's extra variable, the largest peak
            if self.wish.gentle == "duration":
                bound, free = bound * float(shares.max()), 1.0
            elif self.wish.gentle == "peak_acceleration" and order == 2:
                bound, free = float(np.abs(matrix @ z).max()), 1.0
            if math.isinf(bound):
                continue
            size = np.abs(matrix @ z)
            held = matrix[size > min(0.5, 1.0 - trust) * size.max()] / bound
            if free == 0.0 and size.max() < 0.5 * bound:
                continue
            extra = np.full((len(held), 1), -free)
            rows += [np.hstack([held, extra]), np.hstack([-held, extra])]
            right.append(np.full(2 * len(held), 1.0 - free))
        if self.edge:
            held, most = self._edge_rows(z, trust)
            rows.append(held)
            right.append(most)
        objective = np.zeros(count + 1)
        objective[-1] = 1.0
        if self.wish.gentle in ("rms_acceleration", "travel"):
            size, slope = self._size(z)
            objective[:-1] = slope / size
            objective[-1] = 0.0
        reach = trust * np.maximum(np.abs(z), 0.2 * np.abs(z).max())
        return _solved(
            objective,
            np.vstack(rows),
            np.concatenate(right),
            np.hstack([self.rest, np.zeros((3, 1))]),
            (np.append(z - reach, 0.0), np.append(z + reach, math.inf)),
        )

    def _edge_rows(self, z: FloatArray, trust: float) -> tuple[FloatArray, FloatArray]:
        """Rows that keep the end of the band: a line past the reach held up, strong ones down."""
        size = np.hypot(*z.reshape(2, -1))
        lacks, line = self._edge(z)
        if line < 0 or lacks <= 1.0 - trust or size[line] == 0.0:
            return np.zeros((0, z.size + 1)), np.zeros(0)
        direction = z.reshape(2, -1) / np.maximum(size, 1e-300)
        velocity = size / self.omega
        wanted = min(lacks, 1.0 + 0.5 * trust) * velocity[line]
        cap = np.maximum(wanted / _END, (1.0 - 0.5 * trust) * velocity)
        strong = np.flatnonzero(velocity > (1.0 - trust) * cap)
        numbers = np.append(strong, line)
        signs = np.append(np.ones(strong.size), -1.0)
        held = np.zeros((numbers.size, z.size + 1))
        at = np.arange(numbers.size)
        for part in range(2):
            held[at, numbers + part * size.size] = signs * direction[part, numbers]
        most = np.append(cap[strong] * self.omega[strong], -wanted * self.omega[line])
        return held, most


def _solved(
    objective: FloatArray,
    rows: FloatArray,
    right: FloatArray,
    rest: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
) -> FloatArray | None:
    """Solve a linear programme of few unknowns and many rows, the last unknown left out.

    Only the rows that bind are handed to the solver: those nearest to their bound first, then
    those that the answer breaks, until it breaks none (cutting planes, J. E. Kelley, Journal
    of SIAM 8, 1960). The optimum is that of all rows.
    """
    middle = np.append(0.5 * (bounds[0] + bounds[1])[:-1], 1.0)
    held = np.zeros(len(right), dtype=bool)
    held[np.argsort(right - rows @ middle)[: _FIRST_ROWS * objective.size]] = True
    while True:
        solved = scipy.optimize.linprog(
            objective,
            A_ub=rows[held],
            b_ub=right[held],
            A_eq=rest,
            b_eq=np.zeros(3),
            bounds=[*zip(*(side.tolist() for side in bounds), strict=True)],
            method="highs-ds",
            options={"presolve": False},
        )
        if solved.x is None:
            return None
        broken = (rows @ solved.x > right + _BROKEN * (1.0 + np.abs(right))) & ~held
        if not broken.any():
            return np.asarray(solved.x[:-1])
        held |= broken


def multisine_lines(wish: Wish, moving: float) -> tuple[int, int]:
    """How many times a period is repeated in `moving` seconds, and how many lines it has.

    Examples
    --------
    >>> from hmpim.optimal.wish import Accuracy, ModelRange, RoughModel
    >>> from hmpim.stimulus import Limits
    >>> rough = RoughModel(natural_frequency=10, damping_ratio=0.4)
    >>> wish = Wish(accuracy=Accuracy(), model=rough, model_range=ModelRange(), noise_std=0.1,
    ...             limits=Limits(), fs=200.0, gentle="travel", duration=10.0)
    >>> multisine_lines(wish, 9.6)
    (8, 24)
    """
    natural = max(m.natural_frequency for m in wish.models())
    highest = min(_REACH * natural, 0.4 * wish.fs)
    repeats = max(math.ceil(highest * moving / _LINES - 1e-9), 1)
    return repeats, math.floor(highest * moving / repeats + 1e-9)


def best_multisine(
    wish: Wish,
    total: float,
    *,
    start: FloatArray | None = None,
    starts: int = 3,
    steps: int = 40,
    step: Step | None = None,
) -> Candidate | None:
    """Find the multisine that buys the accuracy most gently in `total` seconds.

    Parameters
    ----------
    wish : Wish
        What is wanted; where it is a short duration, the least share of the limits is sought.
    total : float
        Length of the record in s, tail included.
    start : ndarray, optional
        Shape of an earlier candidate to begin at, in place of the usual starts.
    starts : int
        How many starts; phases differ, as the problem has many minima.
    steps : int
        Linear programmes for each start, at most.
    step : callable, optional
        Called at each of them.

    Returns
    -------
    Candidate or None
        None if `total` leaves no room for the motion.
    """
    moving = math.floor((total - wish.tail) * wish.fs - 2.0 + 1e-6) / wish.fs
    if moving <= 0.0:
        return None
    repeats, lines = multisine_lines(wish, moving)
    if lines < _FEWEST:
        return None
    begins = [_spread(lines, turn) for turn in range(starts)]
    if start is not None:
        begins = [_resized(start, lines)]
    best, plain = None, begins[0]
    # as it comes; then with the end of the band held up; then without its lowest lines
    for first, edge in ((1, False), (1, True), (2, False), (3, False), (4, False), (5, False)):
        if lines - first < _FEWEST or (first > 1 and best is not None and best.use <= 1.0):
            break
        numbers = np.arange(first, lines + 1)
        programme = replace(_programme(wish, moving, total, repeats, numbers), edge=edge)
        descended = [_descend(programme, _without(b, first), steps, step) for b in begins]
        found = sorted((z for z in descended if z is not None), key=programme.cost)
        if not found:
            break
        for z in found:  # the lines alone cannot promise what samples show
            waveform = _waveform(z, repeats * numbers, moving, wish.fs)
            whole = _with(z, first)
            tried = try_out(waveform, wish, family="multisine", total=total, shape=whole, finer=3)
            if tried is not None:
                break
        if tried is not None and z is found[0] and not edge and first == 1:
            return tried
        best = gentler(best, tried)
        if not edge:
            plain = _with(found[0], first)  # without holding the band: on from there, a line less
        if edge or first > 1:
            begins = [plain]
    return best


def _without(z: FloatArray, first: int) -> FloatArray:
    """Leave out the lines before number `first`."""
    return np.ascontiguousarray(z.reshape(2, -1)[:, first - 1 :]).ravel()


def _with(z: FloatArray, first: int) -> FloatArray:
    """Put the lines before number `first` back, as nothing."""
    return np.concatenate([np.zeros((2, first - 1)), z.reshape(2, -1)], axis=1).ravel()


def _descend(
    programme: _Programme, begin: FloatArray, steps: int, step: Step | None
) -> FloatArray | None:
    rest = programme.rest
    z = begin - rest.T @ np.linalg.solve(rest @ rest.T, rest @ begin)
    cost, trust = programme.cost(z), 0.3
    costs = [cost]
    for _ in range(steps):
        if step is not None:
            step()
        z = z * math.exp(float(programme.log_ratios(z)[0].max()))
        trial = programme.step(z, trust)
        reached = math.inf if trial is None else programme.cost(trial)
        if trial is not None and reached < cost:
            z, cost, trust = trial, reached, min(1.5 * trust, 1.0)
            costs.append(cost)
            if len(costs) > _PATIENCE and cost > (1.0 - _LITTLE) * costs[-_PATIENCE]:
                break
        else:
            trust *= 0.4
            if trust < 1e-3:
                break
    return z if math.isfinite(cost) else None


def _resized(z: FloatArray, lines: int) -> FloatArray:
    """Cut lines off, or add weak ones."""
    count = z.size // 2
    both = np.full((2, lines), 1e-3 * np.abs(z).max())
    kept = min(count, lines)
    both[:, :kept] = z.reshape(2, count)[:, :kept]
    return both.ravel()


def _spread(lines: int, turn: int) -> FloatArray:
    """Cosine and sine parts of a start: falling amplitudes, Schroeder's phases, and others.

    M. R. Schroeder, Synthesis of low-peak-factor signals and binary sequences with low
    autocorrelation, IEEE Trans. Information Theory 16, 1970.
    """
    k = np.arange(1, lines + 1)
    phase = -np.pi * k * (k - 1) / lines + turn * 2.399963 * k * k
    size = np.sqrt(k)  # of the acceleration
    return np.concatenate([size * np.cos(phase), size * np.sin(phase)])


def _programme(
    wish: Wish, moving: float, total: float, repeats: int, k: NDArray[np.int_]
) -> _Programme:
    lines = k.size
    omega = 2.0 * np.pi * repeats * k / moving
    count = round(total * wish.fs)
    time = (np.arange(count) - 1) / wish.fs
    angle = np.outer(omega, time)
    basis = np.vstack([np.cos(angle), np.sin(angle)]) * ((time >= 0.0) & (time <= moving))
    basis /= np.concatenate([omega, omega])[:, None] ** 2
    information, wanted = [], []
    for model in wish.models():
        rows = sensitivities(basis, model=model, fs=wish.fs)
        rows -= rows.mean(axis=2, keepdims=True)  # the bias takes the mean away
        information.append(_grams(rows) / wish.noise_std**2)
        wanted.append(wish.wanted(model))
    # peaks: one period, the same as all
    points = _POINTS * int(k[-1])
    instants = np.arange(points) * (moving / repeats / points)
    angle = np.outer(instants, omega)
    cosine, sine = np.cos(angle), np.sin(angle)
    motion = np.array(
        [
            np.hstack([cosine / omega**2, sine / omega**2]),
            np.hstack([-sine / omega, cosine / omega]),
            np.hstack([-cosine, -sine]),
            np.hstack([sine * omega, -cosine * omega]),
        ]
    )
    none = np.zeros(lines)
    rest = np.array(
        [
            np.concatenate([1.0 / k**2, none]),
            np.concatenate([none, 1.0 / k]),
            np.concatenate([np.ones(lines), none]),
        ]
    )
    limits = wish.limits
    bounds = [limits.position, limits.velocity, limits.acceleration, limits.jerk]
    return _Programme(
        wish=wish,
        information=tuple(information),
        wanted=tuple(wanted),
        motion=motion,
        rest=rest,
        bounds=_INSIDE * np.array(bounds),
        moving=moving / total,
        omega=np.asarray(omega, dtype=np.float64),
    )


def _grams(rows: FloatArray) -> FloatArray:
    """Products summed over time, symmetric in z: (4, 2m, n) to (4, 4, 2m, 2m)."""
    many = rows.shape[1]
    flat = rows.reshape(len(PARAMETERS) * many, -1)
    gram = (flat @ flat.T).reshape(len(PARAMETERS), many, len(PARAMETERS), many)
    gram = gram.transpose(0, 2, 1, 3)
    return np.asarray(0.5 * (gram + gram.transpose(0, 1, 3, 2)))


def _waveform(z: FloatArray, k: NDArray[np.int_], moving: float, fs: float) -> RestToRest:
    lines = z.size // 2
    omega = 2.0 * np.pi * k / moving
    cosine, sine = z[:lines] / omega**2, z[lines:] / omega**2
    size = np.hypot(cosine, sine)
    kept = size > 0.0
    core = SumOfSines(
        amplitudes=tuple(size[kept].tolist()),
        frequencies=tuple((k[kept] / moving).tolist()),
        phases=tuple(np.arctan2(cosine, sine)[kept].tolist()),
        duration=moving,
    )
    still, sample = (0.0,) * 6, 1.0 / fs
    return RestToRest(
        core=core,
        sweep_start=sample,
        join=0.0,
        leave=moving,
        lead_in=Quintic(start=0.0, duration=sample, coefficients=still),
        lead_out=Quintic(start=sample + moving, duration=sample, coefficients=still),
        duration=moving + 2.0 * sample,
    )
