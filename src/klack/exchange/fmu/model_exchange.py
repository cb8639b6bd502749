"""Which models a general solver can integrate."""

from klack.exchange.modal_model import ModalModel

__all__ = ["supports_model_exchange"]


def supports_model_exchange(model: ModalModel) -> bool:
    """Whether the forces of a model follow from its states.

    Not so with a squeeze film in series with a compliance: while the contact is open the film
    passes its force on with a time constant that falls with the third power of the gap, down to
    far below any step.  Such a model has co-simulation alone.
    """
    return all(contact.film is None or contact.series_compliance == 0 for contact in model.contacts)
