"""One draw: a system, its stimulus and noise; what is found, the truth, and the bound."""

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.batch.montecarlo.plan import Plan, drawn
from hmpim.batch.rows import PARAMETERS
from hmpim.experiment import run
from hmpim.identify import Estimate, Parameters, identify
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.reading.figures import read_figures
from hmpim.identify.threads import one_thread
from hmpim.model.dynamics import STRUCTURES, second_order_coefficients, theta_of
from hmpim.model.sampled import prepare_input
from hmpim.record import Record
from hmpim.rigs import Sensor
from hmpim.stimulus import Chirp, Stimulus, Sweep

__all__ = ["one_draw"]

Drawn = dict[str, dict[str, Any]]


def one_draw(plan: Plan, number: int) -> dict[str, Any]:
    """Do one draw; the same plan and number give the same row, wherever it is done.

    Parameters
    ----------
    plan : Plan
        What is drawn.
    number : int
        From 0 on; the draw's own stream of random numbers is spawned from the seed by it.

    Returns
    -------
    dict
        ``draw``, the quantities drawn as ``system.delay``, ``structure_true``, ``structure``,
        ``verdict``, ``reason``; for each parameter its value, ``_std``, ``_low``, ``_high``,
        ``_true`` and ``_bound``.
    """
    rng = np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(number,)))
    told: Drawn = {
        table: {name: drawn(law, rng) for name, law in quantities.items()}
        for table, quantities in plan.quantities.items()
    }
    record, clean, truth = _tested(told, rng)
    row: dict[str, Any] = {"draw": number, "structure_true": truth["structure"]}
    row |= {name: told[name.partition(".")[0]][name.partition(".")[2]] for name in plan.varied}
    with one_thread():
        bounds = _bounds(record.inputs[0].values, clean, truth)
    for name in PARAMETERS:
        bound = getattr(bounds, name)
        if bound is not None:
            white = not told["noise"]["correlation"]
            row |= {f"{name}_true": bound.value, f"{name}_bound": bound.std if white else None}
    try:
        pair = identify(record)["y", "u"]
    except Exception as error:  # a draw that cannot be identified is a row, not the study's end
        return {**row, "reason": f"{type(error).__name__}: {error}"}
    row |= {"structure": pair.structure, "verdict": pair.verdict}
    for name in PARAMETERS:
        estimate = getattr(pair.parameters, name)
        if estimate is not None:
            low, high = estimate.ci95 or (None, None)
            row |= {name: estimate.value, f"{name}_std": estimate.spread}
            row |= {f"{name}_low": low, f"{name}_high": high}
    return row


def _tested(told: Drawn, rng: np.random.Generator) -> tuple[Record, NDArray[Any], dict[str, Any]]:
    """The record, what it is without noise, and the truth."""
    s, system, noise = told["stimulus"], told["system"], told["noise"]
    fs = s["fs"]
    top = s["high"] if s["high"] is not None else min(s["high_of_fs"] * fs, s["high_most"])
    waveform = _waveform(s, top)
    frequency = system["natural_frequency"] or system["frequency_of_band"] * top
    truth = {
        "structure": system["structure"],
        "delay": system["delay"],
        "scale_factor": system["scale_factor"] * system["sign"],
        "bias": system["bias"],
        "frequency": frequency,
        "damping_ratio": system["damping_ratio"],
        "fs": fs,
        "highest": top,
    }
    dynamics = (
        {"natural_frequency": frequency, "damping_ratio": system["damping_ratio"]}
        if system["structure"] == "second_order"
        else {"time_constant": 1 / (2 * np.pi * frequency)}
    )
    sensor = Sensor(
        delay=truth["delay"], scale_factor=truth["scale_factor"], bias=truth["bias"], **dynamics
    )
    played = run(sensor, Stimulus(waveform=waveform, fs=fs), rng=0)
    u, clean = played.inputs[0].values, played.outputs[0].values
    std = noise["std"]
    if std is None:
        std = noise["std_of_amplitude"] * s["amplitude"] * abs(truth["scale_factor"])
    truth["noise_std"] = std
    y = clean + std * _noise(u.size, noise["correlation"], rng)
    return Record.from_arrays({"u": u}, {"y": y}, fs=fs), clean, truth


def _waveform(s: dict[str, Any], top: float) -> Chirp | Sweep:
    """A chirp, or with extinction the sweep whose amplitude falls; of the amplitude asked for."""
    if not s["extinction"]:
        return Chirp(band=(s["low"], top), duration=s["duration"], amplitude=s["amplitude"])

    def sweep(gain: float) -> Sweep:
        return Sweep(
            band=(s["low"], top), duration=s["duration"], gain=gain, extinction=s["extinction"]
        )

    time = np.arange(0.0, s["duration"], 1.0 / s["fs"])
    height = float(np.max(np.abs(sweep(1.0).motion(time).position)))
    return sweep(s["amplitude"] / height)


def _noise(size: int, correlation: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise of unit standard deviation, white or of first order."""
    if not correlation:
        return rng.standard_normal(size)
    settle = 2000
    white = np.sqrt(1 - correlation**2) * rng.standard_normal(size + settle)
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -correlation], white)[settle:])


def _bounds(u: NDArray[Any], clean: NDArray[Any], truth: dict[str, Any]) -> Parameters:
    """Each parameter's true value, and the least standard deviation that white noise allows."""
    fs, structure = truth["fs"], STRUCTURES[truth["structure"]]
    lag = np.array([1 / (2 * np.pi * truth["frequency"])])
    if structure.order == 2:
        lag = second_order_coefficients(truth["frequency"], truth["damping_ratio"])
    theta = theta_of(structure, lag * fs ** np.arange(1, structure.order + 1))
    theta = np.concatenate([[truth["delay"] * fs], theta])
    problem = Problem(
        source=prepare_input(u, "bandlimited"), y=clean, valid=None, longest_delay=float(u.size)
    )
    part = Part(problem, structure, theta)
    gain = np.array([truth["scale_factor"]])
    rows = np.vstack([part.slopes(gain, np.zeros(0)), part.rows, np.ones((1, u.size))])
    size = np.linalg.norm(rows, axis=1)
    scaled = rows / size[:, None]
    std = truth["noise_std"]
    covariance = std**2 * np.linalg.inv(scaled @ scaled.T) / np.outer(size, size)
    noise = Estimate(value=std, std=std / np.sqrt(2 * u.size), ci95=None)
    parameters, _, _ = read_figures(
        structure,
        np.concatenate([theta, gain, [truth["bias"]]]),
        covariance,
        fs=fs,
        highest=truth["highest"],
        effective=float(u.size),
        noise=noise,
        units=("", ""),
    )
    return parameters
