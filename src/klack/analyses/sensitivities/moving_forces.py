r"""Forces of a run with derivatives, at fixed times: what the noise follows from.

A run with derivatives records means over intervals whose ends move along,
:math:`t(p) = t + \dot t\,\delta p`.  Noise is a function of the force over the time of a clock.
The impulse of an interval that moves is :math:`f h`; what enters and leaves at the ends of one that
stays is the force there times their speed (Reynolds' transport theorem), so that the mean over it
has

.. math::

    \dot f_\text{fixed} = \dot f + \frac{f\,(\dot t_1 - \dot t_0)}{h}
        - \frac{f(t_1)\,\dot t_1 - f(t_0)\,\dot t_0}{h} ,

with the force at an end as the mean of both neighbours.  The sum is the derivative of the impulse.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from klack.analyses.noise.force import stop_force
from klack.analyses.noise.source import NoiseSource, net_force, stroke_sources
from klack.analyses.noise.window import first_part
from klack.analyses.stroke.record import StrokeStudy
from klack.case.valve import ValveCase
from klack.signals import TimeSeries
from klack.simulation.tangent_run import TangentRun

__all__ = ["MovedForces", "moved_forces", "transported"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MovedForces:
    """Forces behind the noise of a run, and their derivatives with one parameter.

    Parameters
    ----------
    source : NoiseSource
        Of the run.
    stops : mapping of str to array [N per unit]
        Derivative of the force of each stop at the times of ``source``.
    net : array or None [N per unit]
        Of the net force.
    """

    source: NoiseSource
    stops: Mapping[str, Floats]
    net: Floats | None

    def at(self, amount: float) -> NoiseSource:
        """Forces where the parameter has changed by an amount, to first order.

        All but the strongest impact alone, from which no measure is read.
        """
        net = self.source.net
        return replace(
            self.source,
            stops=tuple(
                replace(stop, force=_added(stop.force, amount, self.stops[stop.name]))
                for stop in self.source.stops
            ),
            net=net if net is None or self.net is None else _added(net, amount, self.net),
        )


def moved_forces(
    study: StrokeStudy, case: ValveCase, run: TangentRun, direction: int
) -> MovedForces:
    """Differentiate the forces of a run at fixed times.

    Parameters
    ----------
    study : StrokeStudy
        Of this run alone.
    case : ValveCase
        Whose section ``noise`` counts.
    run : TangentRun
    direction : int
    """
    source = stroke_sources(study, case=case)[0]
    variant = study.reference
    followed, _ = first_part(variant.result)
    moving, late = run.rates(direction)
    rates, _ = first_part(moving)
    part = (late.size - 1) * (rates.time.size - 1) // (moving.time.size - 1)
    stops = {}
    for stop in source.stops:
        force = stop_force(followed, stop.name).values
        ends = _evenly(late[: part + 1], force.size)
        along = stop_force(rates, stop.name).values + force * np.diff(ends) / rates.step
        stops[stop.name] = along + transported(force, ends, rates.step)
    net = net_force(study, replace(variant, result=followed))
    pushed = net_force(study, replace(variant, result=rates))
    of_net = None
    if net is not None and pushed is not None:  # its impulse is what the speed changes by
        ends = _evenly(late[: part + 1], net.values.size)
        of_net = pushed.values + transported(net.values, ends, net.step)
    return MovedForces(source=source, stops=stops, net=of_net)


def transported(values: Floats, late: Floats, step: float) -> Floats:
    """What enters intervals that stay less what leaves them, where times move, per interval.

    Parameters
    ----------
    values : array, shape (n,)
        Means over the intervals.
    late : array, shape (n + 1,) [s per unit]
        Derivatives of the times of their ends.
    step : float [s]
        Length of an interval.
    """
    at_ends = np.concatenate([values[:1], 0.5 * (values[:-1] + values[1:]), values[-1:]])
    return -np.diff(at_ends * late) / step


def _evenly(late: Floats, count: int) -> Floats:
    """Derivatives of the times of the ends of so many intervals, straight between those known."""
    places = np.arange(late.size) * (count / (late.size - 1))
    return np.interp(np.arange(count + 1), places, late)


def _added(series: TimeSeries, amount: float, rates: Floats) -> TimeSeries:
    return replace(series, values=series.values + amount * rates[: series.values.size])
