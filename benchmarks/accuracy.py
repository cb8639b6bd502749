"""Reduced against full order on the shipped cases, and the solid against the axisymmetric valve."""

from number import Number, Size

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.case import load_case, shipped_cases
from klack.case.schema import Case
from klack.contact.restitution import Deviation

__all__ = ["axisymmetric_twin", "numbers", "whole_rim"]

_LEVELS = ("reduced-none", "reduced-attachment", "reduced-participation", "reduced", "full")


def numbers(size: Size) -> list[Number]:
    """Deviations of every reduced level; goals where they are promised."""
    if size == "smallest":
        return _case("witness", history_goal=None, levels=("reduced", "full"))
    found = _case("demo-valve-axisymmetric", history_goal=0.015)
    if size == "full":
        found += _case("sphere-on-rod", history_goal=0.015)
        found += _case("demo-valve", history_goal=0.01)
        found += _solid_against_axisymmetric()
    return found


def _case(
    name: str, *, history_goal: float | None, levels: tuple[str, ...] = _LEVELS
) -> list[Number]:
    """One shipped case at all levels."""
    study = run_impact(load_case(shipped_cases()[name]), levels=levels)
    found = [
        Number(
            name=f"{name}, reduced, energy residual",
            value=abs(study.levels["reduced"].energy_residual),
            unit="-",
            goal=1e-9,
        ),
        Number(name=f"{name}, full, energy lost", value=_loss(study), unit="-", goal=1e-3),
    ]
    for level, deviation in study.deviations.items():
        goal = history_goal if level == "reduced" else None
        found += _deviations(f"{name}, {level}", deviation, history_goal=goal)
    return found


def _deviations(name: str, deviation: Deviation, *, history_goal: float | None) -> list[Number]:
    """Reduced against full order; goals only where they are promised."""
    promised = history_goal is not None
    goals = (0.005, 0.01, 0.005, 0.002, history_goal, 1.0)
    fields = ("peak_force", "contact_time", "impulse", "restitution", "history_l2")
    units = ("-", "-", "-", "-", "of peak", "dB")
    return [
        Number(
            name=f"{name}, {field.replace('_', ' ')}",
            value=abs(float(getattr(deviation, field))),
            unit=unit,
            goal=goal if promised else None,
        )
        for field, unit, goal in zip((*fields, "third_octave_max_dB"), units, goals, strict=True)
    ]


def _loss(study: ImpactStudy) -> float:
    ledger = study.levels["full"].history.ledger
    return ledger.contact_dissipation / ledger.initial


def whole_rim(case: Case) -> Case:
    """The same case with every support closed round the circumference."""
    bodies = {}
    for name, body in case.bodies.items():
        fixed = body.fixed and tuple(s.model_copy(update={"sectors": None}) for s in body.fixed)
        bodies[name] = body.model_copy(update={"fixed": fixed})
    return case.model_copy(update={"bodies": bodies})


def axisymmetric_twin(case: Case) -> Case:
    """The same meridian meshes as axisymmetric bodies."""
    bodies = {}
    for name, body in case.bodies.items():
        geometry = body.geometry.model_copy(update={"model": "axisymmetric", "layers": None})
        bodies[name] = body.model_copy(update={"geometry": geometry})
    return case.model_copy(update={"bodies": bodies})


def _solid_against_axisymmetric() -> list[Number]:
    """Full order of one valve, three-dimensional and axisymmetric, held all round."""
    from klack.acoustics.comparison import compare_histories

    solid = whole_rim(load_case(shipped_cases()["demo-valve"]))
    twin = axisymmetric_twin(solid)
    runs = [run_impact(case, levels=("full",)) for case in (twin, solid)]
    deviation = compare_histories(*(run.levels["full"].history for run in runs))
    goals = {"peak_force": 0.005, "contact_time": 0.01, "restitution": 0.003, "history_l2": None}
    return [
        Number(
            name=f"solid against axisymmetric, {field.replace('_', ' ')}",
            value=abs(getattr(deviation, field)),
            unit="-",
            goal=goal,
        )
        for field, goal in goals.items()
    ]
