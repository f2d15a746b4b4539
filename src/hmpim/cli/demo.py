"""``hmpim demo``: from limits to a sensor's parameters, without any hardware."""

from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.identify import write_result
from hmpim.cli.terminal import output_console, say, working

__all__ = ["TRUTH", "demo"]

TRUTH = {
    "delay": 0.15,
    "scale_factor": 1.0,
    "bias": 0.6,
    "noise_std": 0.1,
    "natural_frequency": 10.0,
    "damping_ratio": 0.4,
    "delay_low_frequency": 0.16273,
    "bandwidth_phase90": 1.5340,
    "bandwidth_phase90_without_delay": 10.0,
    "bandwidth_3db": 13.745,
    "peak_gain_db": 2.6954,
}
"""Of the sensor of Fig. 17; the last five are what the others amount to, in closed form."""


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the page and the JSON file.")
    ] = Path("out/demo"),
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the sensor's noise.")] = 7,
) -> None:
    """Design a stimulus inside limits, apply it to a simulated sensor, find its parameters.

    The sensor is that of the paper's Fig. 17, so the true values are known; they are printed next
    to the results.
    """
    check_files(folders={"--out": out})
    from hmpim.experiment import run
    from hmpim.identify import identify
    from hmpim.report import About, print_result
    from hmpim.rigs import Sensor
    from hmpim.stimulus import Limits, design

    out.mkdir(parents=True, exist_ok=True)
    limits = Limits(position=10.0, velocity=70.0, acceleration=8500.0, unit="deg")
    with working("Designing the stimulus"):
        stimulus = design(band=(0.1, 20.0), duration=10.0, fs=200.0, limits=limits)
    sensor = Sensor(
        delay=TRUTH["delay"],
        natural_frequency=TRUTH["natural_frequency"],
        damping_ratio=TRUTH["damping_ratio"],
        scale_factor=TRUTH["scale_factor"],
        bias=TRUTH["bias"],
        noise_std=TRUTH["noise_std"],
        limits=limits,
    )
    with working("Testing the sensor"):
        record = run(sensor, stimulus, rng=seed)
    with working("Identifying"):
        result = identify(record)
    peaks = stimulus.peaks
    say(
        f"Stimulus: 0.1 to 20 Hz in 10 s; peaks {peaks.position:.3g} of 10 deg, "
        f"{peaks.velocity:.3g} of 70 deg/s, {peaks.acceleration:.4g} of 8500 deg/s²"
    )
    print_result(result, output_console(), truth=TRUTH)
    page, saved = out / "report.html", out / "result.json"
    about = About(
        title="Demonstration", under_test="Simulated sensor of Fig. 17", test=f"Seed {seed}"
    )
    write_result(result, json=saved, report=page, stimulus=stimulus, truth=TRUTH, about=about)
    say(f"Page:   {page}")
    say(f"Result: {saved}")
