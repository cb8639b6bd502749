r"""Output of a lift sensor for a motion, and its inverse for smooth motions.

An inductive sensor follows the tip through a low pass,

.. math:: D(\tau_0 s)\, y = x, \qquad D(s) = 1 + s \quad\text{or a Butterworth polynomial},
          \quad \tau_0 = 1 / (2 \pi f_b),

so that 3 dB are lost at the bandwidth ``f_b`` (polynomials: Butterworth 1930).  What it shows is
``sensitivity * y + offset``, rounded to its resolution.
"""

from math import pi

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.low_pass import low_passed
from klack.measurement.sensor import LiftSensor
from klack.measurement.uniform import uniform_step

__all__ = ["sense", "sensor_delay", "sensor_poles", "sensor_polynomial"]


def sense(
    time: NDArray[np.float64], lift: NDArray[np.float64], sensor: LiftSensor
) -> NDArray[np.float64]:
    """Lift as the sensor shows it [m].

    The low pass is solved exactly for a motion that runs straight between the samples, at any
    step (:mod:`klack.low_pass`); before the first sample the valve is taken to rest there.

    Parameters
    ----------
    time : array, shape (n,) [s]
        Uniform.
    lift : array, shape (n,) or (strokes, n) [m]
        True lift at the place of the sensor.
    sensor : LiftSensor

    Returns
    -------
    array, as ``lift`` [m]

    Raises
    ------
    InputError
        If the time is not uniform.
    """
    step = uniform_step(time, "sense: time")
    shown = np.asarray(lift, dtype=np.float64)
    if sensor.bandwidth is not None:
        shown = low_passed(shown, sensor_poles(sensor), step)
    shown = sensor.sensitivity * shown + sensor.offset
    if sensor.resolution > 0.0:
        shown = sensor.resolution * np.round(shown / sensor.resolution)
    return np.asarray(shown)


def sensor_delay(sensor: LiftSensor) -> float:
    """Time by which the sensor shows a steady motion late [s]: ``1 / (2 pi f_b)`` for order 1."""
    return float(sensor_polynomial(sensor)[1]) if sensor.bandwidth is not None else 0.0


def sensor_poles(sensor: LiftSensor) -> NDArray[np.complex128]:
    """Poles of the low pass [1/s], shape (order,); none without a bandwidth.

    After a sharp event what the sensor shows differs from the smooth motion by
    ``sum_i C_i exp(p_i t)``.
    """
    if sensor.bandwidth is None:
        return np.empty(0, dtype=np.complex128)
    _, denominator = scipy.signal.butter(sensor.order, 2.0 * pi * sensor.bandwidth, analog=True)
    return np.asarray(np.roots(denominator), dtype=np.complex128)


def sensor_polynomial(sensor: LiftSensor) -> NDArray[np.float64]:
    """Coefficients ``d_i`` [s^i] of ``x = d_0 y + d_1 y' + d_2 y'' + ...``, shape (order + 1,).

    With them a polynomial that the sensor shows gives the polynomial of the motion exactly.
    """
    if sensor.bandwidth is None:
        return np.ones(1)
    _, denominator = scipy.signal.butter(sensor.order, 2.0 * pi * sensor.bandwidth, analog=True)
    ascending = np.asarray(denominator[::-1], dtype=np.float64)
    return np.asarray(ascending / ascending[0])
