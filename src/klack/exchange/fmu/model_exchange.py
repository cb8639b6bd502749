"""Which models a general solver can integrate."""

from klack.contact.laws import HuntCrossley
from klack.exchange.modal_model import ModalModel, ModelContact

__all__ = ["feels_speed", "supports_model_exchange"]


def supports_model_exchange(model: ModalModel) -> bool:
    """Whether the forces of a model follow from its states.

    Not so where forces depend on the rate of a surface that a series compliance keeps apart from
    the body: a squeeze film (its time constant falls with the third power of the gap, down to far
    below any step) or a damped law.  Such a model has co-simulation alone.
    """
    return not any(
        contact.series_compliance > 0.0 and feels_speed(contact) for contact in model.contacts
    )


def feels_speed(contact: ModelContact) -> bool:
    """Whether the force of a contact depends on the rate of its gap."""
    return contact.film is not None or isinstance(contact.law, HuntCrossley)
