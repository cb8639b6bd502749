"""One design of a noise study as named arrays over time, frequency and third octaves."""

import numpy as np
from numpy.typing import NDArray

from klack.analyses.noise.record import NoiseDesign
from klack.exchange.results.naming import identifiers
from klack.exchange.results.variables import Variable
from klack.signals import TimeSeries

__all__ = ["noise_variables"]

Floats = NDArray[np.float64]


def noise_variables(design: NoiseDesign) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of a design: forces of the stops, bodies, sound of one click.

    Over ``band``, the middles of third octaves: energies of force, radiated energy, sound
    exposure.  Forces share the axis ``time`` where they are sampled alike; every stop has a
    frequency axis of its own.

    Parameters
    ----------
    design : NoiseDesign
    """
    bands = design.band_middle
    coordinates = {
        "band": Variable(
            ("band",), bands, {"units": "Hz", "long_name": "middle of the third octave"}
        )
    }
    variables = {
        "net_share": Variable(
            ("band",),
            design.net_share,
            {"units": "1", "long_name": "share of the energy of the forces not balanced within"},
        )
    }

    sampled: dict[tuple[float, float, int], str] = {}

    def add_series(name: str, series: TimeSeries, meaning: str) -> None:
        new = f"{name}_time" if sampled else "time"
        axis = sampled.setdefault((series.start, series.step, series.values.size), new)
        coordinates[axis] = Variable((axis,), series.time, {"units": "s", "long_name": "time"})
        variables[name] = Variable(
            (axis,), series.values, {"units": series.unit, "long_name": meaning}
        )

    def add_bands(name: str, energy: Floats, unit: str, meaning: str) -> None:
        variables[name] = Variable(("band",), energy, {"units": unit, "long_name": meaning})

    stops = identifiers([item.stop for item in design.stops])
    for name, stop in zip(stops, design.stops, strict=True):
        add_series(f"{name}_force", stop.force, f"force on '{stop.stop}', means over steps")
        add_bands(f"{name}_force_energy", stop.bands.energy, "N^2 s", f"force on '{stop.stop}'")
        axis = f"{name}_frequency"
        coordinates[axis] = Variable(
            (axis,), stop.frequency, {"units": "Hz", "long_name": "frequency"}
        )
        variables[f"{name}_force_level"] = Variable(
            (axis,),
            stop.level,
            {"units": "dB", "long_name": f"strongest impact on '{stop.stop}', re 1 uN s"},
        )
    bodies = identifiers([body.name for body in design.bodies], stops)
    for name, body in zip(bodies, design.bodies, strict=True):
        radiated = body.radiated.sum(axis=0)
        add_bands(f"{name}_radiated", radiated, "J", f"sound energy of '{body.name}', estimate")
        add_series(f"{name}_blocked_force", body.blocked, f"force of '{body.name}' on its support")
    if design.sound is not None:
        add_series("sound_pressure", design.sound.pressure, "sound of one click, estimate")
        exposure = np.full(bands.size, np.nan)  # heard from 20 Hz to 20 kHz only
        heard = np.isin(design.stops[0].bands.number, design.sound.bands.number)
        exposure[heard] = design.sound.bands.energy
        add_bands("sound_exposure", exposure, "Pa^2 s", "sound of one click, estimate")
    return variables, coordinates
