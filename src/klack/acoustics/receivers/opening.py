"""Frequency responses from a file, by its ending."""

from pathlib import Path

from klack.acoustics.receivers.responses import FrequencyResponses
from klack.acoustics.receivers.tables import read_array_responses, read_table_responses
from klack.acoustics.receivers.uff import read_uff_responses

__all__ = ["read_responses"]

_UFF = (".uff", ".unv", ".ufb", ".bunv")
_ARRAYS = (".mat", ".h5", ".hdf5", ".nc", ".npz")


def read_responses(path: Path, *, quantity: str | None = None) -> FrequencyResponses:
    """Read frequency responses from a universal file, a table, or a file of arrays.

    Parameters
    ----------
    path
        ``.uff``, ``.unv``; ``.mat``, ``.h5``, ``.nc``, ``.npz``; others are text tables.
    quantity
        ``acceleration``, ``velocity`` or ``displacement``, where a universal file does not say.
    """
    ending = path.suffix.lower()
    if ending in _UFF:
        return read_uff_responses(path, quantity=quantity)
    return read_array_responses(path) if ending in _ARRAYS else read_table_responses(path)
