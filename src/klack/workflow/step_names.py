"""Names of the faces of STEP files, asked before anything is meshed."""

import json
from pathlib import Path

from klack.cache.entry import Entry
from klack.cache.remember import remembered
from klack.cache.setting import result_cache
from klack.case.bodies import CaseFile
from klack.case.surface_names import require_surface_names
from klack.mesh.solid import face_names, read_step

__all__ = ["require_step_names"]


def require_step_names(case: CaseFile) -> None:
    """Check every surface that a case names of a body from a STEP file.

    Raises
    ------
    InputError
        For a name that the file does not have, with its key in the case.
    """
    known = {
        name: _faces(body.geometry.step.file)
        for name, body in case.bodies.items()
        if body.geometry.step is not None
    }
    require_surface_names(case, known)


def _faces(path: Path) -> tuple[str, ...]:
    """Names of the faces of a STEP file; what is in it counts, not its name or its date."""
    return remembered(
        result_cache() if path.is_file() else None,
        "faces",
        ("STEP", path.read_bytes() if path.is_file() else b""),
        lambda: tuple(dict.fromkeys(face_names(read_step(path)))),
        pack=lambda names: Entry(arrays={}, text=json.dumps(names)),
        unpack=lambda entry: tuple(json.loads(entry.text)),
    )
