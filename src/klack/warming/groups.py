"""Groups of functions, each compiled by a small calculation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType
from typing import Any, Literal

__all__ = ["GROUPS", "Group", "all_steps"]


@dataclass(frozen=True, slots=True)
class Group:
    """Functions that belong together.

    Parameters
    ----------
    words
        For the table of ``klack warm``.
    compute
        Small calculation that calls each of them with the types of a real one.
    """

    words: str
    compute: Callable[[], None]


def _loop(start: Literal["rest", "free"] = "free") -> None:
    from klack.simulation.network_run import simulate_network
    from klack.warming.small_valves import small_valve

    case = small_valve()
    run, rows = case.run, case.network.network().rows()
    simulate_network(rows, duration=run.duration, step=run.step, record=run.record, start=start)


def _components() -> None:
    from klack.mechanics.force import constant_force_step
    from klack.network.step_function import compile_step, evaluate

    for step in all_steps():
        compile_step(step)
    evaluate(constant_force_step, [1.0], [], [0.0] * 4, 4)  # as gases find their steady flow


def _derivatives() -> None:
    from klack.analyses.linearisation.run import run_linearisation
    from klack.simulation.tangent_loop import tangent_address
    from klack.simulation.tangent_run import compile_tangents
    from klack.warming.small_valves import small_valve

    case = small_valve()
    compile_tangents(case.network.network().rows(), step=case.run.step)
    run_linearisation(case)
    for step in all_steps():
        tangent_address(step)


def all_steps() -> set[Any]:
    """Step functions of the components in all rooms."""
    from klack.network.catalogue import component_classes
    from klack.network.step_function import is_step_function

    rooms = {kind.__module__.rpartition(".")[0] for kind in component_classes()}
    files = [
        import_module(f"{room}.{file.name}")
        for room in sorted(rooms)
        for file in iter_modules(import_module(room).__path__)
    ]
    return {step for file in files for step in vars(file).values() if is_step_function(step)}


def _valve() -> None:
    from klack.analyses.stroke.run import run_stroke
    from klack.case.any_case import load_valve_case

    case = load_valve_case("demo-stroke")
    short = case.run.model_copy(update={"duration": 2e-6, "check_steps": False})
    run_stroke(case.model_copy(update={"run": short}))


def _spatial() -> None:
    from klack.analyses.stroke.run import run_stroke
    from klack.warming.small_valves import spatial_valve

    run_stroke(spatial_valve("axisymmetric"))
    run_stroke(spatial_valve("swept"))


def _small(impacts: str) -> None:
    getattr(import_module("klack.warming.small_impact"), impacts)()


def _impact() -> None:
    from klack.analyses.impact.run import run_impact
    from klack.case.reader import load_case

    run_impact(load_case("witness"), levels=("reduced", "interface"))


def _radiation() -> None:
    import numpy as np

    from klack.acoustics.boundary.revolved import Meridian
    from klack.acoustics.boundary.triangles import Triangles

    angle = np.linspace(np.pi, 0.0, 9)
    points = np.vstack([np.eye(3), -np.eye(3)])  # of an octahedron
    corners = [
        [0, 1, 2],
        [1, 3, 2],
        [3, 4, 2],
        [4, 0, 2],
        [1, 0, 5],
        [3, 1, 5],
        [4, 3, 5],
        [0, 4, 5],
    ]
    for mesh in (
        Meridian(nodes=np.column_stack([np.abs(np.sin(angle)), np.cos(angle)])),
        Triangles(points=points, corners=np.array(corners)),
    ):
        mesh.kernels(mesh.centres, 1.0)


GROUPS: Mapping[str, Group] = MappingProxyType(
    {
        "loop": Group("time loop of a network", _loop),
        "derivatives": Group("the same loop and steps with derivatives", _derivatives),
        "valve": Group("meshes, bodies and contacts of a valve", _valve),
        "spatial": Group("strokes in three dimensions", _spatial),
        "components": Group("steps of all components", _components),
        "rest": Group("static equilibrium", partial(_loop, "rest")),
        "levels": Group("time loops of impacts", partial(_small, "plain_impacts")),
        "features": Group(
            "the same with guide, friction, yield, rough faces", partial(_small, "featured_impacts")
        ),
        "impact": Group("meshes, bodies and contacts of impacts", _impact),
        "radiation": Group("boundary elements of noise", _radiation),
    }
)
"""All groups, those first that take longest."""
