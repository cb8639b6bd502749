"""Opens a measured file with the reader of its format: by content, else by suffix."""

import re
from pathlib import Path

from klack.errors import InputError, refuse_if
from klack.input.section import refuse_lfs_pointer
from klack.measurement.recording import Recording

__all__ = ["open_recording"]


_UFF_SET = re.compile(rb"(15|55|58b?|82|151|164|18|24\d\d)\b")


def open_recording(path: str | Path, *, time_step: float | None = None) -> Recording:
    """Open a measured file of any known format.

    Parameters
    ----------
    path
        CSV and other text tables, MDF 3 and 4, TDMS, UFF (sets 58 and 58b), HDF5, netCDF, MATLAB.
    time_step [s]
        Where the file has no time of its own.

    Raises
    ------
    InputError
        If the file is missing, damaged, of no known format or without time.
    MissingExtraError
        If the package that reads this format is not installed.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise InputError(
            str(path),
            got=(error.strerror or "no access").lower(),
            expected="a measured file",
            hint="check the path and the permissions of the file.",
        ) from error
    refuse_if(
        not head,
        str(path),
        got="an empty file",
        expected="a measured file",
        hint="export the measurement again.",
    )
    refuse_lfs_pointer(path)
    return _open(path, head, time_step)


def _open(path: Path, head: bytes, time_step: float | None) -> Recording:
    """Open by content; readers are imported when needed."""
    if head[:8] in (b"MDF     ", b"UnFinMF "):
        from klack.measurement.files.mdf_file import MdfFile

        return MdfFile(path, time_step)
    if head[:4] == b"TDSm":
        from klack.measurement.files.tdms_file import TdmsFile

        return TdmsFile(path, time_step)
    if head[:8] == b"\x89HDF\r\n\x1a\n" or head[512:520] == b"\x89HDF\r\n\x1a\n":
        from klack.measurement.files.hdf5_file import Hdf5File

        return Hdf5File(path, time_step)
    if head[:4] in (b"CDF\x01", b"CDF\x02"):
        from klack.measurement.files.hdf5_file import NetCdf3File

        return NetCdf3File(path, time_step)
    if head[:6] == b"MATLAB" or path.suffix.lower() == ".mat":
        from klack.measurement.files.stored_arrays import MatlabFile

        return MatlabFile(path, time_step)
    if path.suffix.lower() in (".uff", ".unv", ".uf58") or _is_uff(head):
        from klack.measurement.files.uff_file import UffFile

        return UffFile(path)
    _refuse_foreign(path, head)
    from klack.measurement.files.csv_file import CsvFile

    return CsvFile(path, time_step)


def _is_uff(head: bytes) -> bool:
    lines = [line.strip() for line in head.splitlines()[:2]]
    return len(lines) == 2 and lines[0] == b"-1" and _UFF_SET.match(lines[1]) is not None


_FOREIGN = {
    b"CDF\x05": ("a netCDF file of 64 bits", "convert it: nccopy -k nc4 old.nc new.nc."),
    b"PK\x03\x04": ("a zip archive or an Excel workbook", "export it as CSV, or unpack it."),
    b"\x1f\x8b": ("a compressed file", "unpack it first."),
    b"\xd0\xcf\x11\xe0": ("an old Office file", "export it as CSV."),
    b"%PDF": ("a PDF", "give the measured data."),
    b"PAR1": ("a Parquet file", "export it as CSV or HDF5."),
    b"\x93NUMPY": ("a numpy array without names and units", "save it as CSV with a header."),
}


def _refuse_foreign(path: Path, head: bytes) -> None:
    """Raise for files that are no text."""
    known = next((about for start, about in _FOREIGN.items() if head.startswith(start)), None)
    if known is None:
        nulls = head.count(b"\x00")  # UTF-16 has one in nearly every pair of bytes
        odd = head[1::2].count(b"\x00")
        if nulls == 0 or (nulls > len(head) // 3 and odd in (0, nulls)):
            return
        known = "binary data of an unknown format", "export it as CSV, MDF4, TDMS or HDF5."
    raise InputError(
        str(path),
        got=known[0],
        expected="text (CSV), MDF, TDMS, UFF, HDF5 or MATLAB",
        hint=known[1],
    )
