"""Make the picture of the how-to page of a common rail: ``python docs/common_rail_pictures.py``.

From a run of ``docs/how-to/common_rail.yaml`` comes common-rail.svg.
"""

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from klack.case.any_case import load_valve_case
from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

DOCS = Path(__file__).parent
CASE = DOCS / "how-to" / "common_rail.yaml"
ORDER = (1, 3, 4, 2)
FIRST, CYCLE, CYCLES = 1e-3, 25e-3, 4
_COLOURS = dict(zip(ORDER, ("blue", "orange", "green", "red"), strict=True))


def main() -> None:
    """Run the case and draw it."""
    with rc_context(STYLE):
        (DOCS / "images" / "common-rail.svg").write_bytes(svg(figure(run())))


def run() -> NetworkResult:
    """The case over its whole duration."""
    case = load_valve_case(CASE)
    return simulate_network(
        case.network.network().rows(), duration=case.run.duration, record=case.run.record
    )


def injected(result: NetworkResult) -> dict[int, list[float]]:
    """Injected mass [kg] of each injector, cycle by cycle."""
    time = result.time
    step = time[1] - time[0]
    masses: dict[int, list[float]] = {}
    for place, number in enumerate(ORDER):
        flow = result.channels[f"injector{number}_holes mass flow"].values
        starts = FIRST + (np.arange(CYCLES) + place / 4) * CYCLE
        masses[number] = [
            float(step * flow[(time > start) & (time <= start + CYCLE / 4)].sum())
            for start in starts
        ]
    return masses


def figure(result: NetworkResult) -> Figure:
    """Rail, wave, flows and injected masses."""
    drawn = Figure(figsize=(9.0, 7.2), layout="constrained")
    (rail, wave), (flows, masses) = drawn.subplots(2, 2)
    time = 1e3 * result.time
    rail.plot(time, 1e-5 * result.channels["rail pressure"].values, color=COLOURS["black"], lw=0.9)
    rail.set_title("pressure in the rail")
    rail.set_ylabel("pressure [bar]")
    shown = (time >= 0.5) & (time <= 7.0)
    for name, label, colour, width in (
        ("injector1_body", "injector 1, injects", "blue", 1.2),
        ("rail", "rail", "black", 1.2),
        ("injector3_body", "injector 3, the next", "orange", 1.2),
    ):
        pressure = 1e-5 * result.channels[f"{name} pressure"].values[shown]
        wave.plot(time[shown], pressure, color=COLOURS[colour], lw=width, label=label)
    wave.set_title("wave of the first injection")
    wave.legend(loc="upper left")
    for number in ORDER:
        flow = 1e3 * result.channels[f"injector{number}_holes mass flow"].values
        cycle = (time >= 25.0) & (time <= 50.0)
        flows.plot(
            time[cycle], flow[cycle], color=COLOURS[_COLOURS[number]], lw=1.0, label=f"{number}"
        )
        highest = np.argmax(np.where(cycle, flow, 0.0))
        flows.text(time[highest] + 0.5, flow[highest] + 0.25, f"{number}", ha="center")
    flows.set_title("flow of each injector, second cycle")
    flows.set_ylabel("mass flow [g/s]")
    flows.set_ylim(top=12.0)
    for number, values in injected(result).items():
        cycles = np.arange(1, CYCLES + 1)
        masses.plot(
            cycles, 1e6 * np.array(values), "o-", color=COLOURS[_COLOURS[number]], lw=1.0,
            label=f"{number}",
        )  # fmt: skip
    masses.set_xticks(range(1, CYCLES + 1))
    masses.set_title("injected mass")
    masses.set_xlabel("cycle")
    masses.set_ylabel("mass [mg]")
    masses.legend(title="injector", loc="lower right")
    for axes in (rail, wave, flows):
        axes.set_xlabel("time [ms]")
    for axes in (rail, wave, flows, masses):
        axes.grid(visible=True, color="#dddddd", lw=0.5)
    return drawn


if __name__ == "__main__":
    main()
