"""A body of a contact in the meridian plane, with its static solutions and what of it may yield."""

from collections.abc import Mapping
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Floats
from klack.elasticity.body import ElasticBody
from klack.elasticity.statics import Flexibility
from klack.materials import Material

__all__ = ["LoadedBody"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadedBody:
    """One of the two bodies of a contact.

    Parameters
    ----------
    body : ElasticBody
        In the meridian plane.
    flexibility : Flexibility
    materials : mapping of str to Material
        Of its solids; those with hardening yield.
    """

    body: ElasticBody
    flexibility: Flexibility
    materials: Mapping[str, Material]

    @property
    def yields(self) -> bool:
        """Whether any of its solids may yield."""
        return any(material.hardening is not None for material in self.materials.values())

    @property
    def plastic_numbers(self) -> tuple[str | float, ...]:
        """Names of its solids that may yield, each with yield stress and both slopes [Pa]."""
        found: list[str | float] = []
        for solid, material in sorted(self.materials.items()):
            if material.hardening is not None:
                found += [solid, *astuple(material.hardening)]
        return tuple(found)

    def elements_near(self, place: Floats, radius: float) -> NDArray[np.bool_]:
        """Elements that may yield, within a radius of a place [m], shape (n_elements,)."""
        near = []
        for block in self.body.mesh.blocks:
            middle = self.body.mesh.points[block.connectivity].mean(axis=1)
            yields = self.materials[block.solid].hardening is not None
            near.append((np.linalg.norm(middle - place, axis=1) < radius) & yields)
        return np.concatenate(near)
