"""The section ``network`` of a case file."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import (
    BeforeValidator,
    Field,
    GetJsonSchemaHandler,
    ValidationInfo,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from klack.errors import InputError
from klack.input.problem import CaseProblem, one_of
from klack.input.section import Name, Section, Text
from klack.network.catalogue import (
    component_class,
    component_classes,
    fluid_section,
    gas_section,
    type_words,
)
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.units import Pressure, Temperature

__all__ = [
    "AmbientSection",
    "AnyComponent",
    "LateGas",
    "LateSection",
    "NetworkSection",
    "read_component",
]


def read_component(value: Any, context: Any = None) -> Component:
    """Make a component from a mapping with the key ``type``.

    Parameters
    ----------
    context
        Of pydantic; with one, as in a case file, every number needs its unit.  Its
        ``"components"`` are the classes of the user's own that may be used, by their words.

    Raises
    ------
    CaseProblem
        Without a type, or for an unknown one.
    """
    if isinstance(value, Component):
        return value
    if not isinstance(value, Mapping) or not isinstance(value.get("type"), str):
        raise CaseProblem(
            (),
            got=f"'{value}'"
            if not isinstance(value, Mapping)
            else f"type: {value['type']}"
            if "type" in value
            else "a mapping without the key 'type'",
            expected=f"type: one of {one_of(type_words())}",
            hint="write e.g. {type: spring, stiffness: 5 N/mm, preload: 20 N}.",
        )
    found = component_class(value["type"], (context or {}).get("components", {}))
    return found.model_validate(
        {key: item for key, item in value.items() if key != "type"}, context=context
    )


class _ComponentSchema:
    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        choices = []
        for found in component_classes():
            reference = handler(found.__pydantic_core_schema__)
            definition = handler.resolve_ref_schema(reference)
            word = {"const": found.type, "type": "string", "description": "Component type."}
            definition["properties"] = {"type": word, **definition.get("properties", {})}
            definition["required"] = ["type", *definition.get("required", [])]
            choices.append(reference)
        return {"oneOf": choices}


def _read_component(value: Any, info: ValidationInfo) -> Component:
    return read_component(value, info.context)


AnyComponent = Annotated[Component, BeforeValidator(_read_component), _ComponentSchema()]
"""Field for any registered component, ``{type: ..., ...}``."""


def _read_fluid(value: Any, info: ValidationInfo) -> Any:
    found = fluid_section()
    if value is None or isinstance(value, found):
        return value
    return found.model_validate(value, context=info.context)


class LateSection:
    """The section ``fluid``, imported when it is used: a name alone, or a mapping."""

    def section(self) -> type[Section]:
        """Class of the section."""
        return fluid_section()

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        section = handler(fluid_section().__pydantic_core_schema__)
        return {"anyOf": [{"type": "string", "examples": ["n-heptane"]}, section]}


def _read_gas(value: Any, info: ValidationInfo) -> Any:
    found = gas_section()
    if value is None or isinstance(value, found):
        return value
    return found.model_validate(value, context=info.context)


class LateGas(LateSection):
    """The section ``gas``, likewise."""

    def section(self) -> type[Section]:
        """Class of the section."""
        return gas_section()

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        section = handler(gas_section().__pydantic_core_schema__)
        return {"anyOf": [{"type": "string", "examples": ["air"]}, section]}


class AmbientSection(Section):
    """Surroundings of the valve."""

    pressure: Pressure = Field(
        default=101_325.0, gt=0, description="Absolute; reference of pressure forces."
    )
    temperature: Temperature = Field(
        default=293.15, gt=0, description="Of the surroundings and of the fluid."
    )

    def ambient(self) -> Ambient:
        """Same surroundings in the form of the rows."""
        return Ambient(self.pressure, self.temperature)


class NetworkSection(Section):
    """Everything around the bodies: components and how they are joined."""

    ambient: AmbientSection = Field(default=AmbientSection(), description="Surroundings.")
    fluid: Annotated[Any, BeforeValidator(_read_fluid), LateSection()] = Field(
        default=None, description="Fluid of the valve; none: a dry valve."
    )
    gas: Annotated[Any, BeforeValidator(_read_gas), LateGas()] = Field(
        default=None, description="Gas of pneumatic components; not needed without them."
    )
    components: Mapping[Name, AnyComponent] = Field(
        min_length=1, description="name: {type: ..., and the keys of that type}."
    )
    connections: tuple[tuple[Text, ...], ...] = Field(
        description="Each a list of the ports, component.port, that meet in one node; "
        "ground and ambient are allowed."
    )

    @model_validator(mode="after")
    def _can_be_joined(self) -> Self:
        self.network()
        return self

    def network(self) -> Network:
        """Join the components; see :class:`klack.network.network.Network`."""
        fluid = self._fluid_here() if self.fluid is not None else None
        gas = self.gas.gas() if self.gas is not None else None
        return Network(self.components, self.connections, self.ambient.ambient(), fluid, gas)

    def _fluid_here(self) -> Any:
        """Fluid at the temperature of the surroundings; errors name its key."""
        try:
            return self.fluid.at(self.ambient.temperature)
        except CaseProblem:
            raise
        except InputError as error:
            fluid, _, about = error.where.partition(": ")
            place = ("ambient", "temperature") if about == "temperature" else ("fluid",)
            raise CaseProblem(
                place, got=error.got, expected=f"{error.expected}, of {fluid}", hint=error.hint
            ) from None
