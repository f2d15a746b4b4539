"""Equations (1) to (7), each against its printed form and against complex-step derivatives."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.stimulus import Chirp, Sweep


class Printed:
    """The paper's equations, as printed, for one real or complex t, one line each."""

    def __init__(self, f_i, f_f, T, n, G, third_sign=-1.0):
        self.a = 2 * math.pi * (f_f - f_i) / T
        self.b = 2 * math.pi * f_i
        self.n, self.G, self.third_sign = n, G, third_sign

    def sigma_1(self, t):
        return self.a * t**2 / 2 + self.b * t

    def sigma_2(self):
        return self.b + self.a / 2

    def equation_1(self, t):
        return cmath.sin(self.sigma_1(t)) / self.sigma_2()

    def equation_2(self, t):
        return (self.b + self.a * t) * cmath.cos(self.sigma_1(t)) / self.sigma_2()

    def equation_3(self, t):
        a, b, s1, s2 = self.a, self.b, self.sigma_1(t), self.sigma_2()
        return a * cmath.cos(s1) / s2 - (b + a * t) ** 2 * cmath.sin(s1) / s2

    def equation_4(self, t):
        return self.b + self.a * t**self.n / 2

    def equation_5(self, t):
        return self.G * cmath.sin(self.sigma_1(t)) / self.equation_4(t)

    def equation_6(self, t):
        a, b, n, s1, s2 = self.a, self.b, self.n, self.sigma_1(t), self.equation_4(t)
        return self.G * (
            (b + a * t) * cmath.cos(s1) / s2 - a * n * t ** (n - 1) * cmath.sin(s1) / (2 * s2**2)
        )

    def equation_7_terms(self, t):
        a, b, n, s1, s2 = self.a, self.b, self.n, self.sigma_1(t), self.equation_4(t)
        sin, cos = cmath.sin(s1), cmath.cos(s1)
        return [
            self.G * term
            for term in (
                a * cos / s2,
                -((b + a * t) ** 2) * sin / s2,
                self.third_sign * a**2 * n**2 * t ** (2 * n - 2) * sin / (2 * s2**3),
                -(n - 1) * a * n * t ** (n - 2) * sin / (2 * s2**2),
                -(b + a * t) * a * n * t ** (n - 1) * cos / s2**2,
            )
        ]


def derivative(f, t):
    """Exact to rounding: Im f(t + ih) / h with h far below rounding."""
    h = 1e-40 * t
    return f(complex(t, h)).imag / h


bands = st.tuples(st.floats(0.01, 10.0), st.floats(1.05, 300.0)).map(lambda p: (p[0], p[0] * p[1]))
durations = st.floats(0.1, 60.0)
extinctions = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 3.0))
shares = st.floats(1e-6, 1.0)


@given(band=bands, T=durations, share=shares)
def test_plain_chirp_is_equations_1_to_3(band, T, share):
    t = share * T
    printed = Printed(*band, T, 0.0, 1.0)
    scale = 1.0 / printed.sigma_2()
    omega = printed.b + printed.a * t
    for waveform in (
        Sweep(band=band, duration=T, gain=1.0, extinction=0.0),
        Chirp(band=band, duration=T, amplitude=scale),
    ):
        at = waveform.motion(np.array([t]))
        slack = 1e-12 * (1 + abs(printed.sigma_1(t))) * scale
        assert at.position[0] == pytest.approx(printed.equation_1(t).real, abs=slack)
        assert at.velocity[0] == pytest.approx(printed.equation_2(t).real, abs=slack * omega)
        bound = slack * (omega**2 + printed.a)
        assert at.acceleration[0] == pytest.approx(printed.equation_3(t).real, abs=bound)


@given(band=bands, T=durations, n=extinctions, G=st.floats(0.01, 100.0), share=shares)
@example(band=(0.1, 40.0), T=10.0, n=0.83, G=54.0, share=1e-6)
@example(band=(0.1, 20.0), T=10.0, n=1.0, G=4.0, share=0.5)
def test_position_velocity_acceleration_are_equations_5_6_7(band, T, n, G, share):
    t = share * T
    printed = Printed(*band, T, n, G, third_sign=+1.0)
    at = Sweep(band=band, duration=T, gain=G, extinction=n).motion(np.array([t]))
    rounding = 1e-12 * (1 + abs(printed.sigma_1(t)))
    size = G / printed.equation_4(t)
    omega = printed.b + printed.a * t
    assert at.position[0] == pytest.approx(printed.equation_5(t).real, abs=rounding * size)
    size_6 = rounding * (size * omega + size * n / t)
    assert at.velocity[0] == pytest.approx(printed.equation_6(t).real, abs=size_6)
    assert at.velocity[0] == pytest.approx(derivative(printed.equation_5, t), abs=size_6)
    terms = [term.real for term in printed.equation_7_terms(t)]
    size_7 = rounding * (sum(map(abs, terms)) + size * omega**2 + size * n * omega / t)
    assert at.acceleration[0] == pytest.approx(sum(terms), abs=size_7)
    assert at.acceleration[0] == pytest.approx(derivative(printed.equation_6, t), abs=size_7)


@given(band=bands, T=durations, n=st.floats(0.2, 3.0), share=st.floats(0.01, 1.0))
def test_third_term_of_equation_7_has_the_wrong_sign_in_print(band, T, n, share):
    t = share * T
    as_printed = Printed(*band, T, n, 1.0)
    terms = [term.real for term in as_printed.equation_7_terms(t)]
    # only where the term can be seen at all beside the others
    assume(abs(terms[2]) > 1e-6 * sum(map(abs, terms)))
    true = derivative(as_printed.equation_6, t)
    scale = sum(map(abs, terms)) * (1 + as_printed.sigma_1(t))
    assert sum(terms) - 2 * terms[2] == pytest.approx(true, abs=1e-11 * scale)
    assert abs(sum(terms) - true) > abs(terms[2])


def test_no_extinction_is_the_constant_divisor_of_equation_1():
    with_4 = Printed(0.1, 10.0, 10.0, 0.0, 1.0)
    assert with_4.equation_4(3.0) == pytest.approx(with_4.sigma_2(), rel=1e-15)


@given(band=bands, T=durations, n=extinctions)
def test_values_at_time_zero(band, T, n):
    sweep = Sweep(band=band, duration=T, gain=2.0, extinction=n)
    at = sweep.motion(np.array([0.0, 5e-324]))
    a, b = sweep.sweep_rate, sweep.start_omega
    if n == 0.0:
        velocity, acceleration = 2.0 * b / (b + a / 2), 2.0 * a / (b + a / 2)
    else:
        velocity, acceleration = 2.0, 0.0 if n == 1.0 else 2.0 * a / b
    assert at.position[0] == 0.0
    assert at.velocity == pytest.approx(velocity, rel=1e-12)
    assert at.acceleration == pytest.approx(acceleration, rel=1e-12)


@pytest.mark.parametrize("n", [0.0, 1.0, 1.2, 2.0])
def test_value_at_time_zero_is_the_limit_where_there_is_one(n):
    sweep = Sweep(band=(0.1, 10.0), duration=10.0, gain=2.0, extinction=n)
    at = sweep.motion(np.array([0.0, 1e-25]))
    size = abs(at.acceleration).max() + sweep.sweep_rate
    assert at.velocity[1] == pytest.approx(at.velocity[0], rel=1e-4)
    assert at.acceleration[1] == pytest.approx(at.acceleration[0], abs=1e-3 * size)


def test_acceleration_is_singular_as_the_paper_s_waveform_is():
    sweep = Sweep(band=(0.1, 40.0), duration=10.0, gain=1.0, extinction=0.8)
    early = np.array([1e-10, 1e-11])
    ratio = np.divide(*sweep.motion(early).acceleration[::-1])
    assert ratio == pytest.approx(10.0**0.2, rel=0.03)  # t^(n-1)


def test_at_rest_outside():
    sweep = Sweep(band=(0.1, 10.0), duration=5.0, gain=3.0, extinction=0.5)
    end = sweep.motion(np.array([5.0])).position[0]
    outside = sweep.motion(np.array([-1.0, -1e-9, 5.0 + 1e-9, 100.0]))
    assert outside.position.tolist() == [0.0, 0.0, end, end]
    assert not outside.velocity.any()
    assert not outside.acceleration.any()


@given(band=bands, T=durations, share=st.floats(0.0, 1.0))
def test_time_of_phase_inverts_the_phase(band, T, share):
    sweep = Sweep(band=band, duration=T)
    phase = share * 2 * math.pi * sweep.cycles
    t = sweep.time_of_phase(phase)
    back = 0.5 * sweep.sweep_rate * t * t + sweep.start_omega * t
    assert back == pytest.approx(phase, rel=1e-12)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"band": (10.0, 0.1)}, r"\(10.0, 0.1\) Hz does not rise"),
        ({"band": (5.0, 5.0)}, "does not rise"),
        ({"band": (0.0, 5.0)}, "start a little above, at 0.1 Hz"),
        ({"band": (-1.0, 5.0)}, "start of the band = -1.0 Hz must be a positive"),
        ({"band": (math.nan, 5.0)}, "start of the band = nan"),
        ({"band": (1.0, math.inf)}, "end of the band = inf Hz"),
        ({"band": 5.0}, "band = 5.0 is not two numbers"),
        ({"band": ("a", 5.0)}, "band = .* is not two numbers"),
        ({"duration": 0.0}, "duration = 0.0 s must be a positive"),
        ({"duration": math.nan}, "duration = nan"),
        ({"gain": -2.0}, "gain = -2.0 must be a positive"),
        ({"extinction": -0.1}, "extinction = -0.1 must lie between 0"),
        ({"extinction": math.nan}, "extinction = nan"),
        ({"extinction": 11.0}, "extinction = 11.0"),
    ],
)
def test_refusals(wrong, message):
    right = {"band": (0.1, 10.0), "duration": 10.0, "gain": 1.0, "extinction": 0.5}
    with pytest.raises(ArgumentError, match=message):
        Sweep(**{**right, **wrong})
