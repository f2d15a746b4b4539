"""``hmpim demo``: from limits to a sensor's parameters, without any hardware."""

from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.identify import write_result
from hmpim.cli.terminal import output_console, say, working

__all__ = ["demo"]


def demo(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the page and the JSON file.")
    ] = Path("out/demo"),
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the sensor's noise.")] = 7,
) -> None:
    """Design a stimulus inside limits, apply it to a simulated sensor, find its parameters.

    The sensor is that of the paper's Fig. 17, so the truth is known and shown beside.
    """
    from hmpim.experiment import run
    from hmpim.identify.identify import identify
    from hmpim.report import print_result
    from hmpim.rigs import Sensor
    from hmpim.stimulus import Limits, design

    out.mkdir(parents=True, exist_ok=True)
    limits = Limits(position=10.0, velocity=70.0, acceleration=8500.0, unit="deg")
    with working("Designing the stimulus"):
        stimulus = design(band=(0.1, 20.0), duration=10.0, fs=200.0, limits=limits)
    with working("Testing the sensor"):
        record = run(Sensor(), stimulus, rng=seed)
    with working("Identifying"):
        result = identify(record)
    truth = {
        "delay": 0.15,
        "scale_factor": 1.0,
        "bias": 0.6,
        "noise_std": 0.1,
        "natural_frequency": 10.0,
        "damping_ratio": 0.4,
        "bandwidth_phase90": 1.534,
    }
    peaks = stimulus.peaks
    say(
        f"Stimulus: 0.1 to 20 Hz in 10 s; peaks {peaks.position:.3g} of 10 deg, "
        f"{peaks.velocity:.3g} of 70 deg/s, {peaks.acceleration:.4g} of 8500 deg/s²"
    )
    print_result(result, output_console(), truth=truth)
    page, saved = out / "report.html", out / "result.json"
    write_result(result, json=saved, report=page, stimulus=stimulus)
    say(f"Page:   {page}")
    say(f"Result: {saved}")
