"""The way of the joint fit: how the input was held, what passes for ahead, where it begins."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.identify.fitting.course import (
    find_beginning,
    free_from_wander,
    looks_held,
    start,
    turn_ahead,
)
from hmpim.identify.fitting.enrich import INTEGRATING, PLAIN
from hmpim.identify.fitting.fit import fit_structure
from hmpim.model.dynamics import STRUCTURES

SWEEP = np.sin(2 * np.pi * (0.001 + 0.004 * np.arange(10_000) / 10_000) * np.arange(10_000))


@pytest.mark.parametrize("every", [2, 3, 4, 5])
def test_a_slow_sweep_through_a_slower_converter_is_held_however_small_its_steps(every):
    held = np.repeat(SWEEP[::every], every)[: SWEEP.size]
    assert np.abs(np.diff(held)).max() < 0.2 * np.ptp(held)
    assert looks_held(held[:5000])
    assert looks_held(np.round(held, 3))


def test_a_slow_sweep_that_was_rounded_is_not():
    slow = SWEEP[:2000]
    rounded = np.round(slow / 0.05) * 0.05
    assert np.count_nonzero(np.diff(rounded)) < 0.5 * rounded.size  # it mostly stands
    assert not looks_held(rounded)
    assert not looks_held(slow)


@pytest.mark.parametrize("steps", [0, 1, 2])
def test_what_is_left_of_the_way_down_is_no_free_response(steps):
    t, omega = np.arange(2000) / 200.0, 20 * np.pi
    u = np.sin(2 * np.pi * (0.1 * t + 0.995 * t**2))
    unit = hmpim.Model(
        delay=0.15, scale_factor=1.0, bias=0.6, denominator=(omega**-2, 0.8 / omega, 1.0)
    )
    y = np.asarray(hmpim.simulate(unit, u, fs=200.0, intersample="bandlimited"))
    y = y + 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    course = start(u, y, None, None, "bandlimited", ("second_order",), None)
    near, structure = np.array([30.6, 1.0, 1.5]), STRUCTURES["second_order"]
    fit = fit_structure(course.problem, structure, near, iterations=steps)
    assert not fit.converged
    assert find_beginning(replace(course, fits=[fit])).counted.begins is None


@pytest.mark.parametrize(("first", "last", "samples"), [(0.001, 0.1, 2000), (0.003, 0.3, 6000)])
def test_what_an_integrator_does_is_neither_ahead_of_its_input_nor_wander(first, last, samples):
    frequency = first * (last / first) ** (np.arange(samples) / samples)
    sweep = np.sin(2 * np.pi * np.cumsum(frequency)) * np.sqrt(first / frequency)
    late = np.append(np.zeros(20), np.cumsum(sweep)[:-20]) / 200
    y = late + 0.002 * np.random.default_rng(1).standard_normal(samples)
    course = start(sweep, y, None, None, None, (*PLAIN, *INTEGRATING), None)
    assert course.data.rough.ahead is not None  # it looks like it
    assert turn_ahead(course) is course
    assert free_from_wander(course) is course
