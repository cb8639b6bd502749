"""Which case a study belongs to, and where its results go; paths from the opened folder."""

import re
from hashlib import sha256
from pathlib import PurePosixPath

from klack.app.folder import OpenFolder
from klack.app.jobs import Job
from klack.errors import InputError, KlackError

__all__ = ["beside_case", "case_of_study", "free_name", "result_of_study"]

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,80}")
_UNMISTAKABLE = re.compile(r"[^.+]+\.yaml")  # path without a separator of the name of its result
_NOT_PLAIN = re.compile(r"[^A-Za-z0-9_.+-]")
_LONGEST_NAME = 100  # bytes


def case_of_study(folder: OpenFolder, study: str, named: str) -> str:
    """Path of the case that a study names, relative to its own file.

    Raises
    ------
    InputError
        For one that is not below the folder, or not there.
    """
    parts: list[str] = list(PurePosixPath(study).parent.parts)
    asked = PurePosixPath(named)
    for part in asked.parts:
        if part == ".." and parts:
            parts.pop()
        elif part == ".." or part.startswith("/") or "\\" in part:
            raise _outside(named)
        elif part != ".":
            parts.append(part)
    path = "/".join(parts)
    try:
        folder.case_text(path)
    except KlackError:
        raise _outside(named) from None
    return path


def _outside(named: str) -> InputError:
    return InputError(
        "study: case",
        got=f"{named[:200]!r}",
        expected="a case file below the folder of the application, and no link",
        hint="name one relative to the file of the study, or choose one here.",
    )


def result_of_study(command: str, study: str, case: str = "") -> str:
    """Folder of the result of a study: the same for the same files, and of no other ones.

    The parts of the path are joined by dots.  A path that has dots of its own, or another ending,
    or that is long, is told from others by a hash after two dots, which no plain name has.

    Parameters
    ----------
    command : str
        ``"study"`` or ``"optimise"``.
    study : str
        File of the study, or case with a study in it.
    case : str
        Chosen for a study that names none.

    Examples
    --------
    >>> result_of_study("study", "valve/study.yaml")
    'klack-results/study/valve.study'
    >>> result_of_study("optimise", "softer.yaml", "valve/case.yaml")
    'klack-results/optimum/softer+valve.case'
    """
    files = [file for file in (study, case) if file]
    name = "+".join(file.removesuffix(".yaml").replace("/", ".") for file in files)
    is_plain = all(_UNMISTAKABLE.fullmatch(file) for file in files)
    if not is_plain or len(name.encode()) > _LONGEST_NAME:
        start = _NOT_PLAIN.sub("_", name)[:_LONGEST_NAME].strip(".")
        name = f"{start}..{sha256('+'.join(map(repr, files)).encode()).hexdigest()[:12]}"
    return f"klack-results/{'optimum' if command == 'optimise' else 'study'}/{name}"


def beside_case(folder: OpenFolder, job: Job | None, name: str, text: str) -> str:
    """Folder of the case of a study, for the files that it names: empty for the opened one.

    Parameters
    ----------
    folder : OpenFolder
    job : Job or None
        That made the study.
    name, text : str
        Of the case, as the study has it.
    """
    if job is not None:
        return _parent(job.case)
    alike = []
    for case in folder.look().cases:
        path = PurePosixPath(case)
        if name in (path.stem, path.parent.name):
            try:
                same = folder.case_text(case) == text
            except KlackError:
                continue
            if same:
                return _parent(case)
            alike.append(case)
    return _parent(alike[0]) if len(alike) == 1 else ""


def _parent(path: str) -> str:
    parent = PurePosixPath(path).parent.as_posix()
    return "" if parent == "." else parent


def free_name(folder: OpenFolder, parent: str, name: str, otherwise: str) -> str:
    """Path of a new file: a name that is plain, and not there yet."""
    stem, _, ending = (name if _PLAIN.fullmatch(name) else otherwise).rpartition(".")
    head = f"{parent}/" if parent else ""
    found = f"{head}{stem}.{ending}"
    count = 2
    while folder.exists(found):
        found = f"{head}{stem}_{count}.{ending}"
        count += 1
    return found
