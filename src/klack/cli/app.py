"""``klack app``: cases, runs and results of a folder in the browser."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.errors import InputError, MissingExtraError

if TYPE_CHECKING:
    from klack.app.access import Access

__all__ = ["app"]


def app(
    folder: Annotated[
        Path, Parameter(name="FOLDER", help="Folder with cases and results, or an empty one.")
    ] = Path(),
    /,
    *,
    port: Annotated[int, Parameter(help="Port to listen on. [default: a free one]")] = 0,
    host: Annotated[
        str,
        Parameter(
            help="Address to listen on. Other machines can connect only with another one than "
            "this, and with a password; what is sent is not encrypted."
        ),
    ] = "127.0.0.1",
    password_file: Annotated[
        Path | None,
        Parameter(help="File whose first line is the password, for another --host."),
    ] = None,
    browser: Annotated[
        bool, Parameter(name="--open", help="Open the address in the browser.")
    ] = True,
) -> int:
    """Show cases, runs and results of a folder in the browser, with sliders that answer.

    Serves this machine alone, at an address with a random token. Runs continue when it is stopped.
    """
    if not 0 <= port <= 65535:
        raise InputError(
            f"--port {port}", got=str(port), expected="0 to 65535", hint="leave it out."
        )
    try:
        from klack.app.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("nicegui", "fastapi", "uvicorn"):
            raise
        raise MissingExtraError("nicegui", "klack app", "app") from None

    def ready(access: "Access") -> None:
        print(
            f"klack app shows {folder.resolve()} at\n  {access.url}\nCtrl-C stops it.", flush=True
        )
        if browser and access.gate is None and sys.stdout.isatty():
            _open(access.url)

    serve(folder, host=host, port=port, password=_password(password_file), ready=ready)
    return 0


def _password(file: Path | None) -> str | None:
    if file is None:
        return None
    try:
        return file.read_text("utf-8").partition("\n")[0].strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"--password-file {file}",
            got=f"an error: {error}",
            expected="a text file that can be read",
            hint="write the password into its first line.",
        ) from None


def _open(address: str) -> None:
    """Open a browser by a file of the user's own: command lines can be read by everybody."""
    import tempfile
    import webbrowser

    with tempfile.NamedTemporaryFile(
        "w", suffix=".html", prefix="klack-", delete=False, encoding="utf-8"
    ) as file:
        file.write(f'<!doctype html><meta http-equiv="refresh" content="0;url={address}">')
    webbrowser.open(Path(file.name).as_uri())
