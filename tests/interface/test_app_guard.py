"""Attacks on the browser application, without a browser: what each must be answered."""

import asyncio
from typing import Any

import pytest

from klack.app.guard import POLICY, Access, Guard, PasswordGate, access_for
from klack.errors import InputError

httpx = pytest.importorskip("httpx")

OWN = "http://127.0.0.1:8123"


async def echo(scope: Any, receive: Any, send: Any) -> None:
    """An application that answers everything, and reads all of a body."""
    assert scope["type"] == "http"
    size = 0
    while True:
        message = await receive()
        size += len(message.get("body", b""))
        if not message.get("more_body"):
            break
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": f"inside {size}".encode()})


def ask(access: Access, method: str, path: str, app: Any = echo, **more: Any) -> Any:
    async def run() -> Any:
        transport = httpx.ASGITransport(app=Guard(app, access, largest=1000))
        cookies = more.pop("cookies", None)
        async with httpx.AsyncClient(transport=transport, base_url=OWN, cookies=cookies) as client:
            return await client.request(method, path, **more)

    return asyncio.run(run())


@pytest.fixture
def access() -> Access:
    return access_for("127.0.0.1", 8123, None)


@pytest.fixture
def inside(access: Access) -> dict[str, str]:
    return {access.cookie: access.session}


def test_without_the_token_nothing_is_answered(access):
    for path in ("/", "/case?path=a.yaml", "/_nicegui/x", "/sound/a.wav", "/?token=", "/?token=x"):
        answer = ask(access, "GET", path)
        assert answer.status_code == 403
        assert "inside" not in answer.text


def test_the_token_gives_a_cookie_that_scripts_and_other_sites_do_not_get(access):
    answer = ask(access, "GET", f"/compare?token={access.token}&a=x%20y")
    cookie = answer.headers["set-cookie"]

    assert answer.status_code == 200
    assert access.token not in answer.text
    assert 'content="0;url=/compare?a=x+y"' in answer.text
    for words in (f"{access.cookie}={access.session}", "HttpOnly", "SameSite=Strict"):
        assert words in cookie


def test_the_token_never_leads_to_another_server(access):
    for path in ("//evil.example/", "/%2F%2Fevil.example", "/\\evil.example"):
        answer = ask(access, "GET", f"{OWN}{path}?token={access.token}")
        target = answer.text.split("url=")[1].split('"')[0]
        assert target.startswith("/")
        assert not target.startswith(("//", "/\\"))


def test_a_script_in_the_address_stays_text(access):
    answer = ask(access, "GET", f'/"><script>alert(1)</script>?token={access.token}')

    assert answer.status_code == 200
    assert "<script" not in answer.text


def test_with_the_cookie_reading_is_answered(access, inside):
    answer = ask(access, "GET", "/", cookies=inside)

    assert (answer.status_code, answer.text) == (200, "inside 0")
    assert answer.headers["content-security-policy"] == POLICY
    assert answer.headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:9999", "https://127.0.0.1:8123"]
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_another_origin_is_refused_though_it_has_the_cookie(access, inside, origin, method):
    assert ask(access, method, "/", cookies=inside, headers={"origin": origin}).status_code == 403


def test_writing_takes_an_origin(access, inside):
    assert ask(access, "POST", "/", cookies=inside).status_code == 403
    assert ask(access, "POST", "/", cookies=inside, headers={"origin": OWN}).status_code == 200


def test_another_name_of_this_machine_is_refused(access, inside):
    """A page of evil.example whose name was pointed at 127.0.0.1 (DNS rebinding)."""
    for host in ("evil.example", "evil.example:8123", "127.0.0.1", ""):
        assert ask(access, "GET", "/", cookies=inside, headers={"host": host}).status_code == 421


def test_bodies_are_bounded_whether_their_length_is_told_or_not(access, inside):
    own = {"origin": OWN}

    async def pieces():
        for _ in range(11):
            yield b"x" * 100

    told = ask(access, "POST", "/", cookies=inside, headers=own, content=b"x" * 1001)
    untold = ask(access, "POST", "/", cookies=inside, headers=own, content=pieces())
    wrong = ask(
        access, "POST", "/", cookies=inside, headers=own | {"content-length": "-1"}, content=b""
    )
    just = ask(access, "POST", "/", cookies=inside, headers=own, content=b"x" * 1000)

    assert [told.status_code, untold.status_code, wrong.status_code] == [413, 413, 413]
    assert just.text == "inside 1000"


def test_a_framework_that_answers_500_for_a_body_above_the_limit_is_not_heard(access, inside):
    async def framework(scope: Any, receive: Any, send: Any) -> None:
        try:
            await echo(scope, receive, send)
        except Exception:
            await send({"type": "http.response.start", "status": 500, "headers": []})
            await send({"type": "http.response.body", "body": b"internal error"})
            raise

    async def pieces():
        for _ in range(11):
            yield b"x" * 100

    own = {"headers": {"origin": OWN}, "cookies": inside, "content": pieces()}
    answer = ask(access, "POST", "/", app=framework, **own)

    assert (answer.status_code, answer.text) == (413, "More than 1000 bytes.\n")


@pytest.mark.parametrize(
    ("origin", "with_cookie", "is_let_in"),
    [
        (OWN, True, True),
        (OWN, False, False),
        ("http://evil.example", True, False),
        (None, True, False),
    ],
)
def test_websockets_take_cookie_and_origin(access, origin, with_cookie, is_let_in):
    sent: list[Any] = []
    entered: list[Any] = []

    async def application(scope: Any, receive: Any, send: Any) -> None:
        entered.append(scope)

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "websocket.connect"}

    headers = [(b"host", b"127.0.0.1:8123")]
    if origin is not None:
        headers.append((b"origin", origin.encode()))
    if with_cookie:
        headers.append((b"cookie", f"{access.cookie}={access.session}".encode()))
    scope = {
        "type": "websocket",
        "path": "/_nicegui_ws/socket.io/",
        "headers": headers,
        "query_string": b"",
    }
    asyncio.run(Guard(application, access)(scope, receive, send))

    assert bool(entered) is is_let_in
    assert [message["type"] for message in sent] == ([] if is_let_in else ["websocket.close"])


def test_other_hosts_take_a_long_password():
    with pytest.raises(InputError, match="no password"):
        access_for("0.0.0.0", 8123, None)
    with pytest.raises(InputError, match="at least 12"):
        access_for("0.0.0.0", 8123, "short")


def test_the_password_and_not_the_token_opens_to_other_hosts():
    access = access_for("192.0.2.7", 8123, "a long enough password")
    there = {"host": "192.0.2.7:8123"}
    own = there | {"origin": "http://192.0.2.7:8123"}

    def login(word: str) -> Any:
        return ask(access, "POST", "/login?next=/case", headers=own, data={"password": word})

    assert ask(access, "GET", f"/?token={access.token}", headers=there).status_code == 303
    assert "token" not in access.url
    good = login("a long enough password")
    assert good.status_code == 200
    assert access.session in good.headers["set-cookie"]
    wrong = login("wrong")
    assert wrong.status_code == 403
    assert 'role="alert"' in wrong.text
    # with no-referrer a browser sends the form with the origin "null", which is refused
    assert wrong.headers["referrer-policy"] == "same-origin"
    assert login("a long enough password").status_code == 403  # closed for a second
    assert ask(access, "POST", "/login", headers=own, content=b"x" * 999_999).status_code == 413


def test_a_gate_keeps_no_password_and_opens_again():
    gate = PasswordGate.of("a long enough password")

    assert "long enough" not in repr(vars(gate))
    assert gate.opens("a long enough password")


def test_secrets_are_not_printed(access):
    assert access.session not in repr(access)
    assert access.token not in repr(access)


def test_the_policy_names_no_other_host():
    words = POLICY.replace(";", " ").split()

    assert not [word for word in words if "://" in word or word in ("*", "ws:", "http:", "https:")]
