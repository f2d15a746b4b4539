import numpy as np
import pytest

from hmpim.rigs.seeker import Seeker


@pytest.mark.parametrize("frequency", [0.3, 1.0, 1.8, 4.0])
def test_stepped_seeker_answers_as_its_closed_form(frequency):
    seeker = Seeker(noise_std=0.0)
    time = np.arange(int(12 / seeker.step)) * seeker.step
    wave = np.exp(2j * np.pi * frequency * time)
    command = np.array([seeker(float(u)) for u in wave.imag])
    whole = round(np.floor(4 * frequency) / frequency / seeker.step)
    late = slice(time.size - whole, None)
    found = 2j * np.mean(command[late] * wave[late].conj())
    s = 2j * np.pi * frequency
    seen = seeker.track_gain * np.exp(-s * seeker.delay)
    closed = seen / (s + seen / (1 + s * seeker.lag))
    assert abs(found - closed) < 0.02 * abs(closed)


def test_a_quarter_turn_at_the_stated_bandwidth():
    seeker = Seeker()
    s = 2j * np.pi * seeker.bandwidth()
    seen = seeker.track_gain * np.exp(-s * seeker.delay)
    closed = seen / (s + seen / (1 + s * seeker.lag))
    assert np.degrees(np.angle(closed)) == pytest.approx(-90.0, abs=1e-6)


def test_reset_brings_the_same_answer_again():
    seeker = Seeker()
    first = [seeker(1.0) for _ in range(200)]
    seeker.reset()
    assert [seeker(1.0) for _ in range(200)] == first


def test_nothing_is_commanded_before_the_delay():
    seeker = Seeker(noise_std=0.0)
    answers = [seeker(5.0) for _ in range(60)]
    assert max(map(abs, answers[:40])) == 0.0 < answers[41]
