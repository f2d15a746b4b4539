"""The estimate so far on the page of the run: what `hmpim.LiveEstimator` says, and nothing else."""

import numpy as np
import pytest

import hmpim
from hmpim.stimulus import Chirp, Step, Stimulus
from hmpim.workbench.live import Live
from hmpim.workbench.looks import begun_looks
from hmpim.workbench.work.driving import Begun, Block
from tests_support import finished

STIMULUS = Stimulus(waveform=Chirp(band=(0.5, 20.0), duration=3.0), fs=200.0, axis="roll")
CHANNELS = (("c", "input", "roll", "deg"), ("r", "output", "roll", "deg"))


async def here(work, *arguments):
    return work(*arguments)


@pytest.fixture(scope="module")
def played():
    """Command and response of a sensor."""
    sensor = hmpim.Sensor(delay=0.05, natural_frequency=8.0, damping_ratio=0.5, noise_std=0.01)
    record = hmpim.run(sensor, STIMULUS, rng=1)
    return record.inputs[0].values, record.outputs[0].values


def test_the_estimate_so_far_is_the_live_estimators(played):
    from hmpim.workbench.parts.table import look_cells

    u, y = played
    t = np.arange(u.size) / 200.0
    live, own = Live(), hmpim.LiveEstimator(STIMULUS, intersample="zoh")
    live.begin(Begun(channels=CHANNELS, limits={}, seconds=3.0, intersample="zoh"))
    looks = begun_looks(STIMULUS, live.intersample)
    verdicts = []
    for part in np.split(np.arange(u.size), 6):
        samples = {"c": (t[part], u[part]), "r": (t[part], y[part])}
        live.take(Block(end=float(t[part][-1]), samples=samples))
        finished(looks.follow(live, "roll", here))
        finished(looks.follow(live, "roll", here))  # another window: nothing is read twice
        said = own.update(u[part], y[part])
        assert looks.look == said
        rows = look_cells(looks.look, passed=looks.passed)[1]
        verdicts.append({row[0]: row[3] for row in rows}["Delay, pure"])
    assert set(verdicts[:-1]) <= {"too early", "doubtful"}
    assert verdicts[-1] == "ok"
    found = said.parameters.natural_frequency
    assert looks.closing[-1] == (said.time, pytest.approx(50 * np.ptp(found.ci95) / found.value))
    assert 1 <= len(looks.closing) <= 6


def test_what_has_no_band_is_not_estimated_while_it_is_played():
    steps = Stimulus(waveform=Step(amplitude=1.0, duration=2.0), fs=200.0)
    assert begun_looks(steps, "zoh") is None
