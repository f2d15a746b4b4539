"""All of Fig. 1 beside delay, dynamics, scale and bias: what a sensor does to its signal.

Each effect has a module and a function of its own; `inspect_effects` asks all of them in an
order in which one does not mistake another's traces for its own, and puts the answers in words.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import RecordError
from hmpim.identify.colour import Drift, NoiseColour, bias_drift, noise_colour
from hmpim.identify.hold import Hold, Updates, detect_hold, updates
from hmpim.identify.input_noise import InputNoise, input_noise
from hmpim.identify.quantization import Quantization, detect_quantization
from hmpim.identify.saturation import Saturation, detect_saturation
from hmpim.identify.signals import as_pair, as_signal
from hmpim.record import Finding

__all__ = [
    "Drift",
    "Effects",
    "Hold",
    "InputNoise",
    "NoiseColour",
    "Quantization",
    "Saturation",
    "Updates",
    "bias_drift",
    "detect_hold",
    "detect_quantization",
    "detect_saturation",
    "input_noise",
    "inspect_effects",
    "noise_colour",
    "updates",
]

_ROUNDED = 0.25
"""Share of the residual's power that rounding must make before it is worth a sentence."""

_DRIFTS = 1e-5
"""Chance of a slope below which it is called drift."""

_ATTENUATED = 1e-3
"""Share by which noise on the input must lower a gain before it is worth a sentence."""

_FEWEST = 50
"""Samples inside the range from which colour and drift are read."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Effects:
    """What was found, None where nothing was, and sentences about what matters.

    Codes of the findings: 'saturation', 'quantization', 'hold', 'drift', 'noise_line',
    'input_noise'.
    """

    saturation: Saturation | None
    quantization: Quantization | None
    hold: Hold | None
    colour: NoiseColour | None
    drift: Drift | None
    input_noise: InputNoise | None
    findings: tuple[Finding, ...]


def inspect_effects(
    u: ArrayLike,
    y: ArrayLike,
    fs: float,
    *,
    prediction: ArrayLike,
    band: tuple[float, float],
    unit: str = "",
    input_unit: str = "",
) -> Effects:
    """Look for every effect of Fig. 1 in one output.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Input and output as recorded, uniform.
    fs : float
        Rate in Hz.
    prediction : array_like, shape (n,)
        Output of a linear model fitted to them, as good as can be had.
    band : tuple of float
        Excited band, Hz.
    unit, input_unit : str
        Units of output and input, for the sentences.

    Returns
    -------
    Effects

    Raises
    ------
    RecordError
        For the wrong shape, unequal lengths, NaN or infinity.
    ArgumentError
        If `fs` or `band` cannot be.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2 / 2))
    >>> y = np.clip(u + 0.01 * np.random.default_rng(0).standard_normal(2000), -0.8, 0.8)
    >>> found = inspect_effects(u, y, 200.0, prediction=0.9 * u, band=(0.1, 10.0), unit="deg")
    >>> found.saturation.high, [finding.code for finding in found.findings]
    (0.8, ['saturation'])
    """
    source, samples = as_pair(u, y)
    model = as_signal("prediction", prediction)
    if model.size != samples.size:
        raise RecordError(
            f"y has {samples.size} samples and the prediction {model.size}; give one for each"
        )
    rounded = detect_quantization(samples)
    held = detect_hold(samples, fs, model)
    counted = np.arange(samples.size) if held is None else updates(held, samples.size, fs).index
    clipped: Saturation | None = detect_saturation(
        samples, model, step=0.0 if rounded is None else rounded.step
    )
    if clipped is not None and clipped.low is None and clipped.high is None:
        clipped = None
    if clipped is not None:
        counted = counted[~clipped.clipped[counted]]
    colour = drift = None
    residual = (samples - model)[counted]
    if counted.size >= _FEWEST and np.any(residual != residual[0]):
        colour = noise_colour(residual, fs if held is None else 1.0 / held.period)
        drift = bias_drift(residual, counted / fs)
    driven = input_noise(source, fs, band=band)
    found = Effects(
        saturation=clipped,
        quantization=rounded,
        hold=held,
        colour=colour,
        drift=drift,
        input_noise=driven,
        findings=(),
    )
    return replace(found, findings=_findings(found, residual, fs, unit, input_unit))


def _findings(
    found: Effects, residual: NDArray[np.float64], fs: float, unit: str, input_unit: str
) -> tuple[Finding, ...]:
    said = []
    of = f" {unit}" if unit else ""
    noise = float(np.std(residual)) if residual.size else 0.0
    if found.saturation is not None:
        levels = [v for v in (found.saturation.low, found.saturation.high) if v is not None]
        said.append(
            Finding(
                code="saturation",
                message=f"The output is clipped at {' and '.join(f'{v:.4g}' for v in levels)}{of} "
                f"({100 * found.saturation.share:.2g} % of the samples). They are taken as beyond "
                "that level; drive it less hard to see the rest.",
            )
        )
    if found.hold is not None:
        period = found.hold.period
        said.append(
            Finding(
                code="hold",
                message=f"The output is updated every {1e3 * period:.4g} ms ({1 / period:.4g} Hz) "
                f"and recorded every {1e3 / fs:.4g} ms. The delay is that of the values when they "
                f"are new; on average they are {500 * period:.3g} ms older when used.",
            )
        )
    if found.quantization is not None and noise > 0:
        share = (found.quantization.noise_std / noise) ** 2
        if share > _ROUNDED:
            said.append(
                Finding(
                    code="quantization",
                    message=f"The output is rounded to steps of {found.quantization.step:.4g}{of}, "
                    f"which makes {100 * min(share, 1.0):.0f} % of the noise's power. "
                    "A finer resolution, or a larger motion, would measure better.",
                )
            )
    if found.drift is not None and found.drift.probability < _DRIFTS:
        said.append(
            Finding(
                code="drift",
                message=f"The bias drifts by {found.drift.slope:.3g}{of} per second, "
                f"{found.drift.total:.3g}{of} over the record. Let the unit warm up, or take the "
                "bias as its value in the middle.",
            )
        )
    if found.colour is not None and found.colour.line_frequency is not None:
        said.append(
            Finding(
                code="noise_line",
                message=f"The noise has a line at {found.colour.line_frequency:.4g} Hz, amplitude "
                f"{found.colour.line_amplitude:.3g}{of}. Look for pick-up from the mains, "
                "a motor or a converter.",
            )
        )
    if found.input_noise is not None and found.input_noise.attenuation > _ATTENUATED:
        unit_in = f" {input_unit}" if input_unit else ""
        said.append(
            Finding(
                code="input_noise",
                message=f"The input carries noise of {found.input_noise.std:.3g}{unit_in}, so "
                f"gains come out about {100 * found.input_noise.attenuation:.2g} % too small. "
                "Use the command, or a better measurement of it, as input.",
            )
        )
    return tuple(said)
