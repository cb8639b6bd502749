"""Functional mock-up unit (FMU) as a file: its description and safe unpacking.

The archive is an untrusted file: no member may leave the folder it is unpacked to, and sizes are
checked before anything is written.  Its binary, though, runs with the rights of the user: take FMUs
only from people that you would take a program from.
"""

import lzma
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Literal

from klack.errors import InputError, MissingExtraError
from klack.input.section import refuse_lfs_pointer

__all__ = ["FmuDescription", "FmuVariable", "describe_fmu", "inspect_fmu", "unpack_fmu"]

Kind = Literal["real", "integer", "boolean", "other"]

_ARCHIVE_ERRORS = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError, EOFError),
    *(NotImplementedError, ValueError, OverflowError),
)
_LARGEST_DESCRIPTION = 64 * 2**20  # bytes
_LARGEST = 2 * 2**30  # bytes, unpacked
_MOST_MEMBERS = 100_000
_DESCRIPTION = "modelDescription.xml"
_KINDS: Mapping[str, Kind] = {
    **{"Real": "real", "Float64": "real"},
    **{"Integer": "integer", "Int32": "integer", "Boolean": "boolean"},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """One variable of an FMU, as its description declares it; ``unit`` is empty if it does not."""

    name: str
    reference: int
    kind: Kind
    causality: str
    variability: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuDescription:
    """Description of an FMU by itself.

    Parameters
    ----------
    path
        Of the ``.fmu``.
    version
        Of FMI.
    identifier, token
        Name of its library; word that library and description must share.
    model_exchange
        Without a solver of its own: klack cannot run it.
    variable_step
        Whether steps of communication may differ in length.
    """

    path: Path
    version: Literal[2, 3]
    identifier: str
    token: str
    model_exchange: bool
    variable_step: bool
    variables: Mapping[str, FmuVariable]


def describe_fmu(path: Path) -> FmuDescription:
    """Read the description of a co-simulation FMU of FMI 2.0 or 3.0.

    Raises
    ------
    InputError
        If the file is no FMU, a damaged one, or one for model exchange only.
    MissingExtraError
        Without the package fmpy.
    """
    fmu = inspect_fmu(path)
    if fmu.model_exchange:
        raise _damaged(
            path,
            "an FMU for model exchange only",
            "an FMU for co-simulation, which has its own solver",
            "export it again as a co-simulation FMU.",
        )
    return fmu


def inspect_fmu(path: Path) -> FmuDescription:
    """As :func:`describe_fmu`, also of an FMU for model exchange only."""
    refuse_lfs_pointer(path)
    status = path.stat()
    return _described(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=16)
def _described(path: Path, _changed: int, _size: int) -> FmuDescription:
    try:
        from fmpy import read_model_description
    except ImportError as error:
        raise MissingExtraError("fmpy", f"reading {path.name} (FMU)", "exchange") from error
    with TemporaryDirectory(prefix="klack-fmu-") as folder:
        with _archive(path) as archive:
            _extract(path, archive, Path(folder), lambda name: name == _DESCRIPTION)
        try:
            # faults of form are common and seldom matter; what is used here is checked below
            read = read_model_description(folder, validate=False)
            version = str(read.fmiVersion)
            variables = {
                item.name: FmuVariable(
                    name=str(item.name),
                    reference=int(item.valueReference),
                    kind="other" if item.dimensions else _KINDS.get(str(item.type), "other"),
                    causality=str(item.causality or "local"),
                    variability=str(item.variability or "continuous"),
                    unit=str(item.unit or getattr(item.declaredType, "unit", None) or ""),
                )
                for item in read.modelVariables
            }
            simulated, exchanged = read.coSimulation, read.modelExchange
        except Exception as error:  # fmpy and its XML reader raise many kinds for a damaged file
            raise _damaged(path, f"a description that cannot be read ({error})") from error
    if version != "2.0" and not version.startswith("3."):
        raise _damaged(path, f"FMI {version}", "FMI 2.0 or 3.0", "export it again as FMI 2.0.")
    offered = next((kind for kind in (simulated, exchanged) if kind and kind.modelIdentifier), None)
    if offered is None:
        raise _damaged(path, "neither co-simulation nor model exchange")
    return FmuDescription(
        path=path,
        version=2 if version == "2.0" else 3,
        identifier=str(offered.modelIdentifier),
        token=str(read.guid),
        model_exchange=offered is not simulated,
        variable_step=offered is simulated
        and bool(simulated.canHandleVariableCommunicationStepSize),
        variables=variables,
    )


def unpack_fmu(fmu: FmuDescription, folder: Path) -> Path:
    """Unpack an FMU into an empty folder for this platform; path of the shared library.

    Raises
    ------
    InputError
        If there is no binary for this platform, or the archive wants out of the folder.
    """
    from fmpy import platform, platform_tuple, sharedLibraryExtension

    place = platform if fmu.version == 2 else platform_tuple
    library = f"binaries/{place}/{fmu.identifier}{sharedLibraryExtension}"
    with _archive(fmu.path) as archive:
        names = archive.namelist()
        if library not in names:
            found = sorted(
                {PurePosixPath(name).parts[1] for name in names if _is_binary(PurePosixPath(name))}
            )
            sources = any(name.startswith("sources/") for name in names)
            raise InputError(
                str(fmu.path),
                got=f"binaries for {', '.join(found) or 'no platform'}",
                expected=f"a binary for this platform, '{library}'",
                hint=f"compile its sources into it: fmpy compile {fmu.path.name}"
                if sources
                else "ask its supplier for a binary for this platform, or for its sources.",
            )
        wanted = (f"binaries/{place}/", "resources/")
        _extract(
            fmu.path, archive, folder, lambda name: name == _DESCRIPTION or name.startswith(wanted)
        )
    (folder / "resources").mkdir(exist_ok=True)
    return folder / library


def _is_binary(name: PurePosixPath) -> bool:
    return len(name.parts) > 2 and name.parts[0] == "binaries"


@contextmanager
def _archive(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except InputError:
        raise
    except (*_ARCHIVE_ERRORS, RuntimeError) as error:  # the last one: a file with a password
        raise _damaged(path, f"an archive that cannot be read ({error})") from error


def _extract(path: Path, archive: zipfile.ZipFile, folder: Path, wanted: object) -> None:
    assert callable(wanted)
    members = archive.infolist()
    if len(members) > _MOST_MEMBERS or sum(item.file_size for item in members) > _LARGEST:
        raise _damaged(
            path,
            f"{len(members)} files of {sum(item.file_size for item in members) / 2**30:.1f} GiB",
            f"at most {_MOST_MEMBERS} files and {_LARGEST / 2**30:.0f} GiB",
            "this is not an ordinary FMU.",
        )
    for item in members:
        name = PurePosixPath(item.filename)
        odd = "\\" in item.filename or ":" in item.filename or "\0" in item.filename
        if odd or name.is_absolute() or ".." in name.parts:
            raise _damaged(
                path, f"a file '{item.filename[:80]}' whose path leaves its folder", "plain names"
            )
    chosen = [item for item in members if wanted(item.filename)]
    described = [item for item in chosen if item.filename == _DESCRIPTION]
    if len(described) != 1 or described[0].file_size > _LARGEST_DESCRIPTION:
        raise _damaged(path, f"no '{_DESCRIPTION}' of an FMU in it")
    for item in chosen:
        archive.extract(item, folder)


def _damaged(
    path: Path,
    got: str,
    expected: str = "a co-simulation FMU",
    hint: str = "export it again, or check it with: fmpy validate.",
) -> InputError:
    return InputError(str(path), got=got, expected=expected, hint=hint)
