"""Physics that tests step themselves, apart from the package."""

import numpy as np
from numpy.typing import NDArray


def second_order_lag(
    time: NDArray[np.float64],
    drive,
    *,
    delay: float,
    natural_frequency: float,
    damping_ratio: float,
    steps: int = 16,
) -> NDArray[np.float64]:
    """Integrate ÿ + 2ζω ẏ + ω² y = ω² u(t - delay) by classical Runge-Kutta, from rest.

    `drive` is the continuous input. Independent of the package: no filter, no exponential.
    """
    omega = 2 * np.pi * natural_frequency
    fine_step = (time[1] - time[0]) / steps
    count = (time.size - 1) * steps
    grid = time[0] + fine_step * np.arange(2 * count + 1) / 2
    u = drive(grid - delay)
    y, v = 0.0, 0.0
    out = np.empty(count + 1)
    out[0] = y
    a, b, h = omega * omega, 2 * damping_ratio * omega, fine_step
    for k in range(count):
        u0, um, u1 = u[2 * k], u[2 * k + 1], u[2 * k + 2]
        k1y, k1v = v, a * (u0 - y) - b * v
        k2y, k2v = v + h / 2 * k1v, a * (um - y - h / 2 * k1y) - b * (v + h / 2 * k1v)
        k3y, k3v = v + h / 2 * k2v, a * (um - y - h / 2 * k2y) - b * (v + h / 2 * k2v)
        k4y, k4v = v + h * k3v, a * (u1 - y - h * k3y) - b * (v + h * k3v)
        y += h / 6 * (k1y + 2 * k2y + 2 * k3y + k4y)
        v += h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
        out[k + 1] = y
    return out[::steps]


def field_chirp(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear chirp 0.1 to 20 Hz in 10 s, amplitude 1, at rest before 0."""
    return np.where(time > 0, np.sin(2 * np.pi * (0.1 * time + 19.9 / 20 * time**2)), 0.0)
