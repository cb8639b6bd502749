"""Server of ``klack app``."""

import asyncio
import socket
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import PlainTextResponse, Response
from nicegui import Client, ui
from nicegui import app as pages_app

from klack.app.answers import typed
from klack.app.folder import OpenFolder
from klack.app.guard import LARGEST_BODY, UPLOAD, Access, Guard, access_for
from klack.app.pages.case_editor import case_editor_page
from klack.app.pages.charts import comparing_page
from klack.app.pages.frame import dead_end, frame
from klack.app.pages.new_study import new_study_page
from klack.app.pages.new_valve import new_valve_page
from klack.app.pages.overview import overview_page
from klack.app.pages.scene import showing_page
from klack.app.pages.sliders import sliders_page
from klack.app.pages.studies import study_points_page
from klack.app.state import State
from klack.app.study_files import points_answer
from klack.errors import InputError, KlackError

__all__ = ["REPORT_POLICY", "build", "serve"]

REPORT_POLICY = (
    # a report may come from anywhere: it runs apart from the application and reaches no server
    "sandbox allow-scripts allow-downloads; default-src 'none'; "
    "script-src 'unsafe-inline' 'unsafe-eval' blob:; style-src 'unsafe-inline'; "
    "img-src data: blob:; media-src data: blob:; font-src data:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
_REPORTS = {
    "report.html": "text/html; charset=utf-8",
    "report.pdf": "application/pdf",
}
_LONGEST_QUERY = 1024  # characters of a path
_NOTHING = "Nothing to show"


def build(state: State, access: Access) -> Guard:
    """The whole application, as it is served."""
    outer = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    _add_files(outer, state)
    _add_static(outer)
    _add_pages(state)
    _add_refusal(state)
    ui.add_head_html(
        '<link rel="stylesheet" href="/static/klack.css"><script src="/static/klack.js"></script>',
        shared=True,
    )
    pages_app.on_startup(state.start)
    pages_app.on_shutdown(state.close)
    ui.run_with(
        outer,
        title="klack",
        favicon=_ICON,
        dark=None,
        tailwind=False,
        language="en-US",
        reconnect_timeout=8.0,
        show_welcome_message=False,
    )
    return Guard(outer, access)


def serve(
    folder: Path,
    *,
    host: str,
    port: int,
    password: str | None,
    ready: Callable[[Access], None],
) -> None:
    """Serve a folder until the process is stopped.

    Parameters
    ----------
    port
        0 takes a free one.
    password
        Needed where the host is not this machine.
    ready
        Called with the access once the port is ours.
    """
    access_for(host, port, password)  # refused before a port is opened
    state = State(OpenFolder(folder))
    with _bound(host, port) as bound:
        access = access_for(host, bound.getsockname()[1], password)
        config = uvicorn.Config(
            build(state, access),
            log_level="warning",
            ws_max_size=LARGEST_BODY,
            server_header=False,
            timeout_graceful_shutdown=2,
        )
        ready(access)
        uvicorn.Server(config).run(sockets=[bound])


def _bound(host: str, port: int) -> socket.socket:
    try:
        family, kind, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        bound = socket.socket(family, kind)
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
        bound.listen()  # who opens the address before the server is ready waits for it
    except (OSError, OverflowError) as error:
        raise InputError(
            f"--host {host} --port {port}",
            got=f"an error: {error}",
            expected="an address of this machine with a free port",
            hint="leave --port out: a free port is then used.",
        ) from None
    return bound


def _add_pages(state: State) -> None:
    for path, page in (
        ("/", overview_page),
        ("/case", case_editor_page),
        ("/sliders", sliders_page),
        ("/compare", comparing_page),
        ("/points", study_points_page),
        ("/new-study", new_study_page),
        ("/show", showing_page),
        ("/new", new_valve_page),
    ):
        _add_page(state, path, page)


def _add_page(state: State, path: str, page: Callable[[State, dict[str, str]], Any]) -> None:
    @ui.page(path, response_timeout=30.0)
    async def shown(request: Request) -> None:
        given = {key: value[:_LONGEST_QUERY] for key, value in request.query_params.items()}
        try:
            await page(state, given)
        except KlackError as error:  # before the page has begun
            with frame(state, _NOTHING):
                dead_end(error)


def _add_refusal(state: State) -> None:
    """Show missing addresses like the others."""

    @pages_app.exception_handler(404)
    async def refused(request: Request, _: Exception) -> Response:
        return _nothing(
            state,
            request,
            InputError(
                f"address {request.url.path[:200]!r}",
                got="no page",
                expected="one that this application links to",
                hint="choose a case or a result in the list.",
            ),
        )


def _nothing(state: State, request: Request, error: KlackError) -> Response:
    with Client(ui.page(""), request=request) as client, frame(state, _NOTHING):
        dead_end(error)
    return client.build_response(request, 404)


def _add_static(outer: FastAPI) -> None:
    """Style and script, read once."""
    kinds = {
        "klack.css": "text/css",
        "klack.js": "text/javascript",
        "points.css": "text/css",
        "points.js": "text/javascript",
    }
    content = {name: files("klack.app").joinpath("static", name).read_bytes() for name in kinds}
    for name in ("scene.js", "three.min.js"):
        content[name] = files("klack.viewer").joinpath(name).read_bytes()
        if name == "scene.js":
            content[name] = typed(content[name].decode()).encode()
        kinds[name] = "text/javascript"

    async def static(name: str) -> Response:
        if name not in content:
            return PlainTextResponse("no such file\n", 404)
        return Response(content[name], media_type=kinds[name])

    outer.add_api_route("/static/{name}", static, response_model=None)


def _add_files(outer: FastAPI, state: State) -> None:

    async def report(request: Request, path: str = "") -> Response:
        place = path[:_LONGEST_QUERY]
        kind = _REPORTS.get(place.rpartition("/")[2])
        try:
            if kind is None:
                raise InputError(
                    f"report {place[:200]!r}",
                    got="another file",
                    expected=" or ".join(_REPORTS),
                    hint="choose Report or PDF in the list of results.",
                )
            content = await asyncio.to_thread(state.folder.read, place)
        except KlackError as error:
            return _nothing(state, request, error)
        headers = {"content-security-policy": REPORT_POLICY, "cache-control": "no-store"}
        return Response(content, media_type=kind, headers=headers)

    async def sound(name: str) -> Response:
        wav = state.sounds.get(name.removesuffix(".wav"))
        if wav is None:
            return PlainTextResponse("this sound is no longer kept\n", 404)
        return Response(wav, media_type="audio/wav", headers={"cache-control": "no-store"})

    async def points(path: str = "", known: str = "") -> Response:
        content = await points_answer(state, path[:_LONGEST_QUERY], known)
        headers = {"cache-control": "no-store"}
        return Response(content, media_type="application/json", headers=headers)

    async def scene(name: str) -> Response:
        packed = state.scenes.get(name.removesuffix(".json"))
        if packed is None:
            return PlainTextResponse("this scene is no longer kept\n", 404)
        headers = {"content-encoding": "gzip", "cache-control": "no-store"}
        return Response(packed, media_type="application/json", headers=headers)

    async def upload(request: Request) -> Response:
        try:
            file = await state.uploads.take(request.stream())
        except (KlackError, OSError) as error:
            return PlainTextResponse(f"{error}\n", 415)
        return PlainTextResponse(file)

    outer.add_api_route("/points-data", points, response_model=None)
    outer.add_api_route(UPLOAD, upload, methods=["POST"], response_model=None)
    outer.add_api_route("/scene/{name}", scene, response_model=None)
    outer.add_api_route("/report", report, response_model=None)
    outer.add_api_route("/sound/{name}", sound, response_model=None)


_ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32"><rect width="32" height="32" '
    'rx="7" fill="#0b62a8"/><path d="M4 20h6l3-13 4 19 3-10 2 4h6" fill="none" stroke="#fff" '
    'stroke-width="2.6" stroke-linejoin="round" stroke-linecap="round"/></svg>'
)
