"""Base class of the components of a network: documented parameters, ports, and rows."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import ValidationError

from klack.errors import InputError
from klack.input.section import Section
from klack.network.across import OffAxisPart
from klack.network.port import FLUID_DOMAINS, Port
from klack.network.rows import Rows

__all__ = ["Component"]


class Component(Section):
    """A part of a valve with ports.

    A component type is one class in one file: its fields are the keys of a case file (with units
    there, SI numbers in Python), and :meth:`add_rows` translates it into rows of the solver.
    Register it in :mod:`klack.network.catalogue`.

    Attributes
    ----------
    type
        Word after ``type:`` in a case file.
    ports
        Override :meth:`port_kinds` when they depend on parameters.
    """

    type: ClassVar[str]
    ports: ClassVar[Mapping[str, Port]] = {}

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise _first_problem(type(self).__name__, error) from None

    # pydantic's mark of an ordinary constructor: else reading a file would lose its context, and
    # with it the demand for units
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def port_kinds(self) -> Mapping[str, Port]:
        """Return the ports of this component."""
        return self.ports

    def dry(self) -> "Component | None":
        """Same part without any fluid; None if nothing is left of it.

        Parts with a port for liquid or gas and sections ``film`` go.
        """
        if any(port.domain in FLUID_DOMAINS for port in self.port_kinds().values()):
            return None
        return self.model_copy(update={"film": None}) if hasattr(self, "film") else self

    def lumped(self, stiffness: float, restitution: float | None) -> "Component | None":
        """Same part in the lumped baseline; None becomes ground.

        Bodies become rigid, an end stop one spring [N/m] and one dashpot; all else stays.
        """
        return self

    def at_start(self) -> "Component":
        """Same part with what it prescribes over time held at its value at time zero.

        Drivers are a matter of their coils: :mod:`klack.magnetics.constant_drive`.
        """
        return self

    def off_axis_parts(self) -> tuple[OffAxisPart, ...]:
        """What also acts across the axis of a needle in three dimensions."""
        return ()

    @abstractmethod
    def add_rows(self, rows: Rows) -> None:
        """Add the rows of this component; ``rows`` has its connections."""


def _first_problem(name: str, error: ValidationError) -> InputError:
    first = error.errors()[0]
    cause = first.get("ctx", {}).get("error")
    where = ".".join([name, *(str(part) for part in first["loc"])])
    if isinstance(cause, InputError):
        key = getattr(cause, "key", ())
        where = ".".join([where, *(str(part) for part in key)])
        return InputError(where, got=cause.got, expected=cause.expected, hint=cause.hint)
    return InputError(
        where,
        got=f"{first.get('input')!r}"[:80],
        expected=first["msg"],
        hint="klack schema describes every key; numbers in Python are SI.",
    )
