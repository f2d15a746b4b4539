"""Make the README's picture: what `hmpim.identify` says of the README's own example.

Run `python examples/bode_picture.py docs/images/bode.png`.
"""

import sys

import hmpim
from hmpim.plots import pair_bode


def main(path: str) -> None:
    limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    stimulus = hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    sensor = hmpim.Sensor(
        delay=0.15, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    result = hmpim.identify(hmpim.run(sensor, stimulus, rng=1))
    figure = pair_bode(result["y", "u"], input_unit="deg", output_unit="deg", fs=result.record.fs)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
