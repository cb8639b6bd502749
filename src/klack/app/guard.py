"""What stands between the network and the application; every request passes here first.

1. the ``Host`` header must name this server: a foreign name that was pointed at this machine (DNS
   rebinding) is refused;
2. an ``Origin`` that is not our own is refused, and one is required for WebSockets and for
   everything but reading;
3. the token in the URL is exchanged for a cookie (HttpOnly, SameSite=Strict); nothing is answered
   without that cookie;
4. bodies of requests are bounded;
5. answers carry a content security policy that allows no other host.
"""

import secrets
import time
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from dataclasses import dataclass, field
from hashlib import scrypt
from hmac import compare_digest
from html import escape
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, parse_qsl, quote, urlencode

from klack.errors import InputError

__all__ = [
    "LARGEST_BODY",
    "LARGEST_UPLOAD",
    "LOCAL_HOSTS",
    "POLICY",
    "SHORTEST_PASSWORD",
    "UPLOAD",
    "Access",
    "Guard",
    "PasswordGate",
    "access_for",
]


LOCAL_HOSTS = ("127.0.0.1", "localhost", "::1")
SHORTEST_PASSWORD = 12  # characters
_PAUSE = 1.0  # [s] after a wrong password, for everybody


@dataclass
class PasswordGate:
    """Password as scrypt hash, checked at most once a second after a wrong one."""

    _salt: bytes
    _hash: bytes
    _closed_until: float = 0.0

    @classmethod
    def of(cls, password: str) -> "PasswordGate":
        """Gate for a password."""
        salt = secrets.token_bytes(16)
        return cls(salt, _hashed(password, salt))

    def opens(self, password: str) -> bool:
        """Whether this is the password; False in the second after a wrong one."""
        now = time.monotonic()
        if now < self._closed_until:
            return False
        if compare_digest(_hashed(password, self._salt), self._hash):
            return True
        self._closed_until = now + _PAUSE
        return False


@dataclass(frozen=True, kw_only=True)
class Access:
    """What a request has to show.

    Parameters
    ----------
    host
        Address of the server.
    token
        In the printed URL; gives the session cookie where no password does.
    session
        Value of that cookie.
    gate
        For other machines: gives the cookie instead of the token.
    names
        Host names of the server.
    """

    host: str
    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    gate: PasswordGate | None = field(default=None, repr=False)
    names: tuple[str, ...] = LOCAL_HOSTS

    @property
    def cookie(self) -> str:
        """Name of the cookie with the port: ports of a host share cookies."""
        return f"klack_{self.port}"

    @property
    def url(self) -> str:
        """Address to open, with the token unless a password is used."""
        start = f"http://{_with_port(self.names[0], self.port)}/"
        return start if self.gate is not None else f"{start}?token={self.token}"

    def is_own_host(self, header: str) -> bool:
        """Whether a ``Host`` header names this server, not a name pointed at it."""
        return header.lower() in {_with_port(name, self.port) for name in self.names}

    def is_own_origin(self, header: str) -> bool:
        """Whether an ``Origin`` header is one of our pages."""
        return header.lower() in {f"http://{_with_port(name, self.port)}" for name in self.names}


def access_for(host: str, port: int, password: str | None) -> Access:
    """Access to a server on a host.

    InputError for another host than this machine without a password, or with a short one.
    """
    if host in LOCAL_HOSTS:
        return Access(host=host, port=port, names=(host, *LOCAL_HOSTS))
    if password is None:
        raise InputError(
            f"--host {host}",
            got="no password",
            expected="one, since other machines could connect",
            hint="klack app --host ... --password-file FILE, or leave --host out.",
        )
    if len(password) < SHORTEST_PASSWORD:
        raise InputError(
            "--password-file",
            got=f"a password of {len(password)} characters",
            expected=f"at least {SHORTEST_PASSWORD}",
            hint="use several words.",
        )
    return Access(
        host=host,
        port=port,
        gate=PasswordGate.of(password),
        names=(*_names_of(host), *LOCAL_HOSTS),
    )


def _names_of(host: str) -> tuple[str, ...]:
    """Names by which other machines may call this server."""
    import socket

    if host not in ("0.0.0.0", "::"):
        return (host.lower(),)
    own = socket.gethostname()
    found = dict.fromkeys([own, socket.getfqdn()])
    try:
        found |= dict.fromkeys(str(info[4][0]) for info in socket.getaddrinfo(own, None))
    except OSError:  # the name of this machine leads nowhere: its plain name stays
        pass
    return tuple(name.lower() for name in found)


def _with_port(name: str, port: int) -> str:
    return f"[{name}]:{port}" if ":" in name else f"{name}:{port}"


def _hashed(password: str, salt: bytes) -> bytes:
    return scrypt(password.encode(), salt=salt, n=2**14, r=8, p=1)


Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LARGEST_BODY = 4 * 2**20  # [byte] of a request
LARGEST_UPLOAD = 64 * 2**20  # [byte] of a STEP file
UPLOAD = "/upload"
_LONGEST_LOGIN = 4096  # [byte]

POLICY = (
    "default-src 'none'; "
    # NiceGUI compiles its templates in the browser, which takes eval; Plotly makes blobs
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; font-src 'self' data:; "
    "img-src 'self' data: blob:; media-src 'self' data: blob:; worker-src 'self' blob:; "
    "connect-src 'self'; frame-src 'self'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'; object-src 'none'"
)

_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"x-frame-options", b"SAMEORIGIN"),
)
_CLOSE = (b"connection", b"close")
_SAFE = ("GET", "HEAD")
_LOGIN = "/login"


class _TooLarge(Exception):
    """More came than is taken."""


class Guard:
    """ASGI application around another; ``largest`` [byte] limits bodies."""

    def __init__(self, app: App, access: Access, *, largest: int = LARGEST_BODY) -> None:
        self.app, self._access, self._largest = app, access, largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or hand it on."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        refusal = self._refusal(scope)
        if refusal is not None:
            await _refuse(scope, send, *refusal)
        elif scope["type"] == "websocket":
            await self.app(scope, receive, send)
        elif scope["path"] == _LOGIN and self._access.gate is not None:
            await self._login(scope, receive, send)
        elif (target := self._exchange(scope)) is not None:
            await self._enter(send, target)
        elif not self._has_session(scope):
            if self._access.gate is not None and scope["method"] in _SAFE:
                await _redirect(send, f"{_LOGIN}?next={quote(scope['path'], safe='')}")
            else:
                await _refuse(scope, send, 403, _NO_TOKEN)
        else:
            await self._hand_on(scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Status and words of a refusal, whatever else is shown."""
        host = _headers(scope, b"host")
        if len(host) != 1 or not self._access.is_own_host(host[0]):
            return 421, "This server does not answer to that host name."
        origin = _headers(scope, b"origin")
        is_reading = scope["type"] == "http" and scope["method"] in _SAFE
        if origin and not (len(origin) == 1 and self._access.is_own_origin(origin[0])):
            return 403, "The request came from a page of another origin."
        if not origin and not is_reading:
            return 403, "The request does not state its origin."
        if scope["type"] == "websocket" and not self._has_session(scope):
            return 403, _NO_TOKEN
        length, largest = _headers(scope, b"content-length"), self._largest_of(scope)
        if length and not (length[0].isdecimal() and int(length[0]) <= largest):
            return 413, f"More than {largest} bytes."
        return None

    def _largest_of(self, scope: Scope) -> int:
        return LARGEST_UPLOAD if scope["path"] == UPLOAD else self._largest

    def _has_session(self, scope: Scope) -> bool:
        found = _cookie(_headers(scope, b"cookie"), self._access.cookie)
        return compare_digest(found.encode(), self._access.session.encode())

    def _exchange(self, scope: Scope) -> str | None:
        """Path for a right token in the URL, without the token."""
        if scope["method"] != "GET" or self._access.gate is not None:
            return None
        query = scope.get("query_string", b"").decode("latin-1")
        given = parse_qs(query).get("token", [""])[0]
        if not compare_digest(given.encode(), self._access.token.encode()):
            return None
        rest = [(key, value) for key, value in parse_qsl(query) if key != "token"]
        return _local(scope["path"]) + (f"?{urlencode(rest)}" if rest else "")

    async def _enter(self, send: Send, target: str) -> None:
        """Set the cookie on a page that leads on: a redirect would not send it."""
        cookie = f"{self._access.cookie}={self._access.session}; Path=/; HttpOnly; SameSite=Strict"
        page = _ENTERED.format(target=escape(target))
        await _answer(
            send, 200, page, b"text/html; charset=utf-8", (b"set-cookie", cookie.encode())
        )

    async def _login(self, scope: Scope, receive: Receive, send: Send) -> None:
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        target = _local(query.get("next", ["/"])[0])
        if scope["method"] == "GET":
            await _ask_password(send, 200, "")
            return
        try:
            body = await _body(receive, _LONGEST_LOGIN)
        except _TooLarge:
            await _refuse(scope, send, 413, "The request is longer than a password.")
            return
        given = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
        assert self._access.gate is not None
        if self._access.gate.opens(given):
            await self._enter(send, target)
        else:
            told = "Wrong password. Wait a second, then try again."
            await _ask_password(send, 403, f'<p role="alert">{told}</p>')

    async def _hand_on(self, scope: Scope, receive: Receive, send: Send) -> None:
        came, begun, is_read = 0, False, scope["method"] in _SAFE
        largest = self._largest_of(scope)

        async def bounded() -> MutableMapping[str, Any]:
            nonlocal came, is_read
            message = await receive()
            is_read = is_read or not message.get("more_body")
            came += len(message.get("body", b""))
            if came > largest:
                raise _TooLarge
            return message

        async def guarded(message: MutableMapping[str, Any]) -> None:
            nonlocal begun
            if came > largest and not begun:  # a framework makes an internal error of it
                return
            if message["type"] == "http.response.start":
                begun = True
                message["headers"] = _with_headers(message.get("headers", ()))
                if not is_read:  # the rest of the body is not waited for
                    message["headers"].append(_CLOSE)
            await send(message)

        try:
            await self.app(scope, bounded, guarded)
        except Exception:
            if came <= largest:
                raise
        if came > largest and not begun:
            await _refuse(scope, send, 413, f"More than {largest} bytes.")


_NO_TOKEN = "Open the address that klack app printed: it holds the token of this session."

_ENTERED = """<!doctype html><html lang="en"><meta charset="utf-8"><title>klack</title>
<meta http-equiv="refresh" content="0;url={target}"><a href="{target}">klack</a></html>"""

_LOGIN_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>klack</title>
<style>:root{{color-scheme:light dark}}body{{font:16px/1.5 system-ui,sans-serif;display:grid;
place-items:center;min-height:90vh;margin:0}}form{{display:grid;gap:.8rem;width:min(20rem,86vw)}}
h1,p{{margin:0}}input,button{{font:inherit;padding:.55rem .7rem}}</style>
<main><form method="post"><h1>klack</h1>{told}<label for="p">Password</label>
<input id="p" type="password" name="password" autofocus required autocomplete="current-password">
<button>Open</button></form></main></html>"""


def _local(path: str) -> str:
    """A path of this server: two slashes at the start would name another."""
    return "/" + quote(path.lstrip("/\\"), safe="/-._~")


def _headers(scope: Scope, name: bytes) -> list[str]:
    return [value.decode("latin-1") for key, value in scope["headers"] if key == name]


def _cookie(headers: Iterable[str], name: str) -> str:
    for header in headers:
        try:
            found = SimpleCookie(header).get(name)
        except CookieError:
            continue
        if found is not None:
            return found.value
    return ""


async def _body(receive: Receive, largest: int) -> bytes:
    parts, size = [], 0
    while True:
        message = await receive()
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > largest:
            raise _TooLarge
        if not message.get("more_body") or message["type"] == "http.disconnect":
            return b"".join(parts)


def _with_headers(headers: Iterable[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    """Headers with ours, unless the answer has its own policy."""
    own = list(headers)
    present = {key.lower() for key, _ in own}
    added = (*_HEADERS, (b"content-security-policy", POLICY.encode()))
    return own + [item for item in added if item[0] not in present]


async def _redirect(send: Send, target: str) -> None:
    await _answer(send, 303, "", b"text/plain", (b"location", target.encode()))


async def _ask_password(send: Send, status: int, told: str) -> None:
    """The form; without any referrer, browsers would send no origin."""
    policy = (b"referrer-policy", b"same-origin")
    page = _LOGIN_PAGE.format(told=told)
    await _answer(send, status, page, b"text/html; charset=utf-8", policy)


async def _answer(
    send: Send, status: int, text: str, kind: bytes, *headers: tuple[bytes, bytes]
) -> None:
    body = text.encode()
    own = [
        (b"content-type", kind),
        (b"content-length", str(len(body)).encode()),
        (b"cache-control", b"no-store"),
        *headers,
    ]
    await send({"type": "http.response.start", "status": status, "headers": _with_headers(own)})
    await send({"type": "http.response.body", "body": body})


async def _refuse(scope: Scope, send: Send, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": text})
        return
    more = () if scope["method"] in _SAFE else (_CLOSE,)  # nor is a body read to its end
    await _answer(send, status, text + "\n", b"text/plain; charset=utf-8", *more)
