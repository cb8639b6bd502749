"""Head of every record: what was computed, by which version, when, and how long it took.

A record is what an analysis leaves behind.  Its fields are stored under their own names
(:mod:`klack.analyses.store`).
"""

from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from time import perf_counter
from typing import Protocol, TypedDict

from klack import __version__
from klack.stages import StageClock

__all__ = [
    "AnyRecord",
    "CaseFields",
    "CaseRecord",
    "Record",
    "RunFields",
    "case_fields",
    "run_fields",
]

_LIBRARIES = ("numpy", "scipy", "numba", "netgen-mesher")


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Begin of every record.

    Parameters
    ----------
    title, description : str
    version : str
        Of klack; ``versions`` holds those of the libraries.
    created : str
        ISO 8601.
    wall_time : float [s]
        Of the whole analysis.
    stage_times : mapping of str to float [s]
    warnings : tuple of str
    """

    title: str
    description: str
    version: str
    versions: Mapping[str, str]
    created: str
    wall_time: float
    stage_times: Mapping[str, float]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class CaseRecord(Record):
    """Begin of the record of one case.

    Parameters
    ----------
    case : str
        Name.
    case_text : str
        The file itself.
    own_components : mapping of str to str
        Components that are not part of klack: first digits of the SHA-256 of their code, by name.
    case_notes : tuple of str
        What the case by itself gives reason to say; added to the warnings.
    """

    case: str
    case_text: str
    own_components: Mapping[str, str] = field(default_factory=dict)
    case_notes: InitVar[tuple[str, ...]] = ()

    def __post_init__(self, case_notes: tuple[str, ...]) -> None:
        """Add the notes of the case to the warnings, each once."""
        new = tuple(note for note in case_notes if note not in self.warnings)
        object.__setattr__(self, "warnings", (*self.warnings, *new))


class _Head(Protocol):
    @property
    def case(self) -> str: ...
    @property
    def case_text(self) -> str: ...
    @property
    def own_components(self) -> Mapping[str, str]: ...
    @property
    def title(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def version(self) -> str: ...
    @property
    def versions(self) -> Mapping[str, str]: ...
    @property
    def created(self) -> str: ...
    @property
    def wall_time(self) -> float: ...
    @property
    def stage_times(self) -> Mapping[str, float]: ...
    @property
    def warnings(self) -> tuple[str, ...]: ...


class AnyRecord(_Head, Protocol):
    """What can be read of every record, be it of one case (:class:`CaseRecord`) or of several."""


class RunFields(TypedDict):
    """Fields of a record that the run itself gives."""

    version: str
    versions: dict[str, str]
    created: str
    wall_time: float
    stage_times: Mapping[str, float]


class CaseFields(TypedDict):
    """Fields of a record that its case gives."""

    case: str
    title: str
    description: str
    case_text: str
    own_components: Mapping[str, str]
    case_notes: tuple[str, ...]


class _Case(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def source(self) -> str: ...
    @property
    def own_components(self) -> Mapping[str, str]: ...
    @property
    def input_notes(self) -> tuple[str, ...]: ...


_version = cache(version)
"""Installed version of a library; reading its description takes milliseconds."""


def run_fields(begin: float, clock: StageClock, *libraries: str) -> RunFields:
    """Versions and times of a run that began at ``begin`` of ``time.perf_counter`` [s]."""
    return {
        "version": __version__,
        "versions": {name: _version(name) for name in (*_LIBRARIES, *libraries)},
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "wall_time": perf_counter() - begin,
        "stage_times": clock.times(),
    }


def case_fields(case: _Case | CaseRecord, case_text: str | None = None) -> CaseFields:
    """Name, title and text of a case, or of the record that an analysis starts from."""
    notes: tuple[str, ...]
    if isinstance(case, CaseRecord):
        name, text, notes = case.case, case.case_text, ()
    else:
        name, text, notes = case.name, case.source, case.input_notes
    return {
        "case": name,
        "title": case.title,
        "description": case.description.strip(),
        "case_text": text if case_text is None else case_text,
        "own_components": case.own_components,
        "case_notes": notes,
    }
