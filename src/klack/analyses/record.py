"""Head of every record, what an analysis leaves behind.

Its fields are stored under their own names (:mod:`klack.analyses.store`).  They are plain arrays
and small frozen records, so that a stored one can be reported again without the solver.
"""

from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from time import perf_counter
from typing import TYPE_CHECKING, Any

from klack import __version__
from klack.machine.stages import StageClock

if TYPE_CHECKING:
    from klack.case.bodies import WrittenCase

__all__ = ["CaseRecord", "Record", "case_fields", "run_fields"]

_LIBRARIES = ("numpy", "scipy", "numba", "netgen-mesher")


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Begin of every record.

    Parameters
    ----------
    version
        Of klack; ``versions`` holds those of the libraries.
    created
        ISO 8601.
    wall_time [s]
        Of the whole analysis.
    stage_times [s]
    """

    title: str
    description: str
    version: str
    versions: Mapping[str, str]
    created: str
    wall_time: float
    stage_times: Mapping[str, float]
    warnings: tuple[str, ...] = ()

    if TYPE_CHECKING:  # every record has them: of one case, or of several

        @property
        def case(self) -> str:
            """Name."""
            raise NotImplementedError

        @property
        def case_text(self) -> str:
            """The file itself."""
            raise NotImplementedError

        @property
        def own_components(self) -> Mapping[str, str]:
            """Components that are not part of klack."""
            raise NotImplementedError


@dataclass(frozen=True, kw_only=True, eq=False)
class CaseRecord(Record):
    """Begin of the record of one case.

    Parameters
    ----------
    case_text
        The file itself.
    own_components
        SHA-256 (first digits) of components that are not klack's, by name.
    case_notes
        Added to the warnings, each once.
    case_folder
        Which files of the case are named from; empty in results of former versions.
    """

    case: str
    case_text: str
    own_components: Mapping[str, str] = field(default_factory=dict)
    case_notes: InitVar[tuple[str, ...]] = ()
    case_folder: str = ""

    def __post_init__(self, case_notes: tuple[str, ...]) -> None:
        """Add notes of the case to the warnings."""
        new = tuple(note for note in case_notes if note not in self.warnings)
        object.__setattr__(self, "warnings", (*self.warnings, *new))


_version = cache(version)
"""Version of an installed library, cached: reading it takes milliseconds."""


def run_fields(begin: float, clock: StageClock, *libraries: str) -> dict[str, Any]:
    """Fields of a run that began at ``begin`` of ``perf_counter`` [s]."""
    return {
        "version": __version__,
        "versions": {name: _version(name) for name in (*_LIBRARIES, *libraries)},
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "wall_time": perf_counter() - begin,
        "stage_times": clock.times(),
    }


def case_fields(case: "WrittenCase | CaseRecord", case_text: str | None = None) -> dict[str, Any]:
    """Fields of a case, or of a record that an analysis starts from."""
    notes: tuple[str, ...]
    if isinstance(case, CaseRecord):
        name, text, notes, folder = case.case, case.case_text, (), case.case_folder
    else:
        name, text, notes = case.name, case.source, case.input_notes
        folder = str(case.folder.absolute())
    return {
        "case": name,
        "title": case.title,
        "description": case.description.strip(),
        "case_text": text if case_text is None else case_text,
        "own_components": case.own_components,
        "case_notes": notes,
        "case_folder": folder,
    }
