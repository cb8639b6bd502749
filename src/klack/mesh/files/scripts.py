"""Scripts that make a mesh when their program runs; there is no mesh in them."""

import re
from pathlib import Path

from klack.errors import InputError

__all__ = ["refuse_script"]

_ENDINGS = (".inp", ".dat")  # MAPDL takes its commands from such files too
_COMMAND = re.compile(
    rb"^[ \t]*(/prep7|/batch|/solu(tion)?|/post1|/filname|finish|et[ \t]*,[ \t]*\d+[ \t]*,|"
    rb"[av]mesh[ \t]*,|esize[ \t]*,|cdread[ \t]*,|keyopt[ \t]*,|(block|cylind|k|v)[ \t]*,.*,)",
    re.IGNORECASE | re.MULTILINE,
)
_HEAD = 20_000  # bytes in which a script shows what it is


def refuse_script(path: Path) -> None:
    """Raise for commands of ANSYS (MAPDL) under an ending that is also that of another program."""
    if path.suffix.lower() not in _ENDINGS or not path.is_file():
        return
    with path.open("rb") as stream:
        found = _COMMAND.search(stream.read(_HEAD))
    if found:
        raise InputError(
            str(path),
            got=f"commands of ANSYS (MAPDL), such as '{found[0].decode('latin-1').strip()}', "
            "without a block of nodes (NBLOCK)",
            expected="a mesh: nodes and elements in blocks",
            hint="run the script in ANSYS, and write its mesh with CDWRITE, DB, NAME, CDB.",
        )
