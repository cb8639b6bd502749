"""Bodies for the pages, in their own process."""

import gzip
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from klack import __version__
from klack.app.answers import PartFacts, Proposal, Review, typed
from klack.app.parts import Part, part_of_step, part_of_table
from klack.app.plan_review import review
from klack.app.proposals import proposal
from klack.app.valve_plan import ValvePlan
from klack.case.any_case import tree_of
from klack.errors import InputError
from klack.viewer.drawn import body_view, view_of_case
from klack.viewer.source import view_of_source
from klack.viewer.view import View, payload_of

__all__ = ["LARGEST_SCENE", "Shapes", "packed_scene"]

LARGEST_SCENE = 48_000_000
"""Characters of a payload: about a million triangles, slow in a browser."""


_MOST_PARTS = 8  # in memory

Sources = Mapping[str, tuple[str, str]]
"""By body: ``"step"`` and a path, or ``"table"`` and the rows of a drawing."""


class Shapes:
    """Scenes as gzipped JSON; parts of a new valve, and their checks."""

    def __init__(self) -> None:
        self._parts: dict[tuple[object, ...], Part] = {}

    def part(self, name: str, source: tuple[str, str]) -> PartFacts:
        """What a STEP file or a drawing holds.

        Raises
        ------
        InputError
            For one that cannot be read.
        """
        return self._part(name, source).facts

    def mesh(self, name: str, source: tuple[str, str], model: str) -> None:
        """Mesh a part for :meth:`parts_scene` and :meth:`proposal`, which take its time else.

        Raises
        ------
        InputError
            For one that cannot be meshed.
        """
        self._part(name, source).picture_mesh(model)

    def parts_scene(self, sources: Sources, model: str) -> bytes:
        """Both parts of a new valve, as drawn, in coarse meshes."""
        none = np.empty(0, dtype=np.int64)
        parts = {name: self._part(name, source) for name, source in sources.items()}
        bodies = tuple(
            body_view(name, part.picture_mesh(model), none, part.facts.words)
            for name, part in parts.items()
        )
        view = View(
            name="parts",
            title="the parts of a new valve",
            source="",
            description="",
            version=__version__,
            bodies=bodies,
            notes=("Meshed coarsely, only for this picture.",),
        )
        return packed_scene(view)

    def proposal(self, sources: Sources, model: str) -> Proposal:
        """See :func:`klack.app.proposals.proposal`."""
        return proposal({name: self._part(name, one) for name, one in sources.items()}, model)

    def review(self, plan: ValvePlan, sources: Sources, place: str) -> Review:
        """See :func:`klack.app.plan_review.review`."""
        parts = {name: self._part(name, source) for name, source in sources.items()}
        return review(plan, parts, Path(place))

    def _part(self, name: str, source: tuple[str, str]) -> Part:
        """A part, kept as long as its file stays."""
        kind, value = source
        key: tuple[object, ...] = (name, kind, value)
        if kind == "step":
            state = Path(value).stat()
            key += (state.st_ino, state.st_size, state.st_mtime_ns)
        found = self._parts.get(key)
        if found is None:
            read = part_of_step(name, Path(value)) if kind == "step" else part_of_table(name, value)
            while len(self._parts) >= _MOST_PARTS:
                del self._parts[next(iter(self._parts))]
            found = self._parts[key] = read
        return found

    def case_scene(self, text: str, path: str) -> bytes:
        """Bodies of a case, also of an unsaved text."""
        return packed_scene(view_of_case(tree_of(text, Path(path)).any_case()))

    def result_scene(self, folder: str) -> bytes:
        """Bodies of a result, with its mode shapes and motion."""
        return packed_scene(view_of_source(Path(folder)))


def packed_scene(view: View) -> bytes:
    """Payload of a view; InputError if it is too large for a browser."""
    histories = tuple(
        replace(line, x_unit=typed(line.x_unit), y_unit=typed(line.y_unit))
        for line in view.histories
    )
    bodies = tuple(replace(body, about=typed(body.about)) for body in view.bodies)
    notes = tuple(typed(note) for note in view.notes)
    view = replace(view, histories=histories, bodies=bodies, notes=notes)
    text = json.dumps(payload_of(view, typed), separators=(",", ":"), allow_nan=False)
    if len(text) > LARGEST_SCENE:
        raise InputError(
            f"bodies of {view.name}",
            got=f"{len(text) / 1e6:.0f} MB of triangles and mode shapes",
            expected=f"at most {LARGEST_SCENE / 1e6:.0f} MB in a page",
            hint="coarser elements; klack show writes a page of any size.",
        )
    return gzip.compress(text.encode("ascii"), 4)
