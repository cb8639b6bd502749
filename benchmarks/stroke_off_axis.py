"""A wet stroke in three dimensions: films that tilt, a guide with a film, contact point by point.

``uv run --group dev python benchmarks/stroke_off_axis.py`` prints the numbers.

The valve is ``docs/how-to/guided_stroke.yaml`` from seed 3 with 80 elastic modes and 18 layers, 864
and 468 contact points, 36 sectors a film; 5 ms are 14 or so impacts.  Its accuracy is that of the
first impact beside steps of a quarter.
"""

import re
from pathlib import Path
from time import process_time

from number import Number, Size

from klack.analyses.stroke.run import variant_network
from klack.assembling.valve import Valve, build_valve
from klack.case.any_case import read_valve_case
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

__all__ = ["numbers"]

CONE = "shape: cone, mean_radius: 0.884 mm, width: 0.1 mm, half_angle: 45 deg"
FILMS = {
    "half_section_stroke.yaml": {
        "seat": CONE,
        "opening": "shape: ring, inner_radius: 1.35 mm, outer_radius: 1.95 mm",
    },
    "armature_off_axis.yaml": {
        "seat": CONE,
        "rest": "shape: ring, inner_radius: 2.9 mm, outer_radius: 3.3 mm",
        "driver": "shape: ring, inner_radius: 1.9 mm, outer_radius: 2.5 mm",
        "opening": "shape: ring, inner_radius: 3.3 mm, outer_radius: 4.2 mm",
    },
}
"""Of the stops of a valve with one mass, and of one with two."""

HOW_TO = Path(__file__).parents[1] / "docs" / "how-to"
STEP = 20e-9
FIRST = 0.26e-3  # [s] until after the first impact


def numbers(size: Size) -> list[Number]:
    """Processor time of the bodies and of a stroke, on one thread."""
    begin = process_time()
    valve = solids() if size == "full" else half_sections()
    prepared = process_time() - begin
    duration = 0.05e-3 if size == "smallest" else 5e-3
    run(valve, STEP, 0.02e-3)  # compiled
    begin = process_time()
    result = run(valve, STEP, duration)
    seconds = process_time() - begin
    error = 0.0
    if result.events:
        peaks = [run(valve, step, FIRST).events[0].peak_force for step in (STEP, STEP / 4.0)]
        error = abs(peaks[0] / peaks[1] - 1.0)
    masses = [*two_masses_over_one(duration), *rubbing()] if size == "full" else []
    points = valve.spatial.model.count if valve.spatial is not None else 0
    name = f"wet stroke off its axis, {points} contact points"
    return [
        Number(name=f"{name}: bodies", value=prepared, unit="s"),
        Number(
            name=f"{name}: {1e3 * duration:.3g} ms",
            value=seconds,
            unit="s",
            goal=2.0 if size == "full" else None,
            accuracy=error,
            accuracy_of="peak of the first impact, beside steps of a quarter",
        ),
        Number(
            name=f"{name}: energy residual", value=abs(result.books.relative_residual), unit="-"
        ),
        *masses,
    ]


def two_masses_over_one(duration: float) -> list[Number]:
    """Processor time of a wet stroke of half sections with two masses over that with one."""
    seconds, left = [], 0.0
    for name, films in FILMS.items():
        text = (HOW_TO / name).read_text(encoding="utf-8")
        for stop, film in films.items():
            wet = rf"\1, film: {{{film}, cut_off: 1 um, pressure: 6 bar}}}}"
            text = re.sub(rf"( {stop}: {{type: end-stop.*}})}}", wet, text)
        for old, new in (
            ("  components:", "  fluid: {name: n-heptane, gas_fraction: 0.01 %}\n  components:"),
            ("angles: 24", "angles: 16"),
            ("size: 0.02 mm, extent: 0.12 mm", "size: 0.03 mm, extent: 0.15 mm"),
            ("400 us, 401 us", "2000 us, 2001 us"),
            ("variants: [dry]", "variants: [wet]"),
        ):
            text = text.replace(old, new)
        valve = built(text)
        run(valve, STEP, 0.02e-3)  # compiled
        begin = process_time()
        result = run(valve, STEP, duration)
        seconds.append(process_time() - begin)
        left = max(left, abs(result.books.relative_residual))
    return [
        Number(
            name=f"wet stroke off its axis, two masses over one: {1e3 * duration:.3g} ms",
            value=seconds[1] / seconds[0],
            unit="-",
            goal=3.0,
            accuracy=left,
            accuracy_of="energy residual",
        )
    ]


def rubbing() -> list[Number]:
    """Processor time of a dry stroke of half sections with friction at both stops."""
    text = (HOW_TO / "half_section_stroke.yaml").read_text(encoding="utf-8")
    valve = built(re.sub(r"(force: [24]0 N)}", r"\1, friction: 0.1}", text))
    run(valve, STEP, 0.16e-3)  # compiled
    begin = process_time()
    result = run(valve, STEP, 0.4e-3)
    seconds = process_time() - begin
    points = valve.spatial.model.count if valve.spatial is not None else 0
    return [
        Number(
            name=f"dry stroke off its axis with friction, {points} points on rings: 0.4 ms",
            value=seconds,
            unit="s",
            accuracy=abs(result.books.relative_residual),
            accuracy_of="energy residual",
        )
    ]


def solids() -> Valve:
    """The valve of the how-to page with 80 modes."""
    text = (HOW_TO / "guided_stroke.yaml").read_text(encoding="utf-8")
    for old, new in (
        ("layers: 12", "layers: 18"),
        ("needle: {count: 12}", "needle: {count: 40}"),
        ("housing: {count: 12}", "housing: {count: 24}"),
        ("pole: {count: 8}", "pole: {count: 16}"),
    ):
        text = text.replace(old, new)
    return built(re.sub(r"shots:.*\n", "placement: {seed: 3}\n", text))


def half_sections() -> Valve:
    """The valve of half sections of the how-to page."""
    return built((HOW_TO / "half_section_stroke.yaml").read_text(encoding="utf-8"))


def built(text: str) -> Valve:
    """Bodies, contact points and network of a case."""
    return build_valve(read_valve_case(text, HOW_TO / "valve.yaml"))


def run(valve: Valve, step: float, duration: float) -> NetworkResult:
    """The stroke of the variant ``wet``, or the only one, so long."""
    variant = valve.case.run.variants[0]
    return simulate_network(
        variant_network(valve, variant).rows(),
        duration=duration,
        step=step,
        record=1e-6,
        spatial=valve.spatial,
    )


if __name__ == "__main__":
    for number in numbers("full"):
        print(f"{number.name}: {number.value:.4g} {number.unit} (accuracy {number.accuracy})")
