"""How a case damps a body."""

from klack.case.bodies import BodyDamping
from klack.reduction.damping import Damping, LossFactor, ModalDamping, RayleighDamping

__all__ = ["damping_of"]


def damping_of(damping: BodyDamping) -> Damping:
    """Damping model that a case asks for."""
    if damping.modal is not None:
        return ModalDamping(ratio=damping.modal)
    if damping.rayleigh is not None:
        return RayleighDamping(alpha=damping.rayleigh.alpha, beta=damping.rayleigh.beta)
    return LossFactor(eta=damping.loss_factor or 0.0)
