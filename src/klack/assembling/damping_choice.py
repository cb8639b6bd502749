"""Damping of a body in a case."""

from klack.case.bodies import BodyDamping
from klack.case.schema import Case
from klack.reduction.damping import Damping, LossFactor, ModalDamping, RayleighDamping

__all__ = ["damping_of", "is_damped"]


def damping_of(damping: BodyDamping) -> Damping:
    """Damping model of a case."""
    if damping.modal is not None:
        return ModalDamping(ratio=damping.modal)
    if damping.rayleigh is not None:
        return RayleighDamping(alpha=damping.rayleigh.alpha, beta=damping.rayleigh.beta)
    return LossFactor(eta=damping.loss_factor or 0.0)


def is_damped(case: Case, name: str) -> bool:
    """Whether a case gives a body any damping."""
    return bool(damping_of(case.bodies[name].damping).ratios([1.0])[0] > 0.0)
