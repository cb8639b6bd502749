"""Attacks on a server that runs: what is sent over the network, and hostile files in its folder."""

import socket
import time
from pathlib import Path
from typing import Any

import psutil
import pytest
from app_browser import LONG, client, server
from browser_pages import watched
from served_app import Served

httpx = pytest.importorskip("httpx")
pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow

__all__ = ["client", "server"]  # fixtures

SCRIPT = "<script>window.attacked=1</script><img src=x onerror=window.attacked=1>"
HOSTILE = f"""<!doctype html><title>report</title><p id=told>nothing</p>{SCRIPT}<script>
const told = document.getElementById("told"), tried = [];
const attempt = (name, act) => {{ try {{ act(); tried.push(name); }} catch {{ }} }};
attempt("parent", () => {{ if (parent === window) throw 0; return parent.document.title; }});
attempt("opener", () => window.opener.document.title);
attempt("cookie", () => document.cookie);
attempt("storage", () => localStorage.setItem("a", "b"));
attempt("dialog", () => {{ if (confirm("?")) return; throw 0; }});
const asked = ["/", "/case?path=case.yaml", "http://127.0.0.1:9/"].map((place) =>
  fetch(place, {{credentials: "include"}}).then(() => tried.push("fetch " + place), () => 0));
asked.push(new Promise((done) => {{
  const socket = new WebSocket(ORIGIN.replace("http", "ws")
    + "/_nicegui_ws/socket.io/?EIO=4&transport=websocket");
  socket.onopen = () => {{ tried.push("websocket"); done(); }};
  socket.onerror = done;
}}));
const form = document.createElement("form");
form.action = "/login"; form.method = "post"; document.body.append(form);
try {{ form.submit(); }} catch {{ }}
Promise.all(asked).then(() => {{ told.textContent = "tried: " + tried.join(", "); }});
</script>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("attacked")
    (place / "secret.yaml").write_text("klack: secret\n")
    inner = place / "cases"
    result = inner / "klack-results" / "a"
    (result / "result.zarr").mkdir(parents=True)
    (result / "report.html").write_text(HOSTILE)
    (inner / "up").symlink_to(place)
    (inner / "case.yaml").write_text(
        f'klack: 1\ntitle: "{SCRIPT}"\n"{SCRIPT}": &a [1]\nbodies: "{SCRIPT}"\n'
    )
    (inner / f"{SCRIPT.replace('/', '')}.yaml").write_text("klack: 1\ntitle: x\n")
    return inner


def memory(server: Served) -> float:
    """Resident memory of the server process [MB]."""
    return psutil.Process(server.process.pid).memory_info().rss / 1e6


def port_of(server: Served) -> int:
    return int(server.base.rpartition(":")[2])


def cookie_of(client: Any) -> str:
    return "; ".join(f"{key}={value}" for key, value in client.cookies.items())


@pytest.mark.parametrize("with_cookie", [True, False])
def test_an_upload_of_a_gigabyte_is_cut_off_and_not_kept(server, client, with_cookie):
    """Chunked, so that its length is not told; the server stops reading and keeps nothing."""
    head = (
        f"POST /_nicegui/x HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\n"
        f"Origin: {server.base}\r\nTransfer-Encoding: chunked\r\n"
        + (f"Cookie: {cookie_of(client)}\r\n" if with_cookie else "")
        + "\r\n"
    )
    piece = b"%x\r\n" % 2**20 + b"x" * 2**20 + b"\r\n"
    before = memory(server)
    sent, most = 0, before
    with socket.create_connection(("127.0.0.1", port_of(server)), timeout=20) as connection:
        connection.sendall(head.encode())
        try:
            while sent < 2**30:
                connection.sendall(piece)
                sent += len(piece)
                most = max(most, memory(server))
        except OSError:  # closed by the server, or it does not read any more
            pass
    assert sent < 64 * 2**20, f"{sent / 1e6:.0f} MB were taken"
    assert most - before < 64, f"{most - before:.0f} MB more"
    assert client.get("/").status_code == 200


def test_a_length_that_is_told_is_refused_before_anything_is_read(server, client):
    head = (
        f"POST /_nicegui/x HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\n"
        f"Origin: {server.base}\r\nContent-Length: {2**30}\r\nCookie: {cookie_of(client)}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", port_of(server)), timeout=20) as connection:
        connection.sendall(head.encode())
        answer = connection.recv(4096)
    assert b" 413 " in answer.split(b"\r\n")[0]


def test_many_slow_connections_do_not_keep_others_out(server, client):
    """Two hundred that send one header and wait."""
    waiting = []
    try:
        for _ in range(200):
            connection = socket.create_connection(("127.0.0.1", port_of(server)), timeout=20)
            connection.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1")
            waiting.append(connection)
        before = memory(server)
        begin = time.monotonic()
        assert client.get("/").status_code == 200
        assert time.monotonic() - begin < 30  # [s]: it answers at all, on a loaded machine
        assert memory(server) - before < 30
    finally:
        for connection in waiting:
            connection.close()
    assert client.get("/").status_code == 200


@pytest.mark.parametrize(
    "path",
    [
        "../secret.yaml",
        "%2e%2e/secret.yaml",
        "..%2fsecret.yaml",
        "up/secret.yaml",
        "/etc/passwd",
        "case.yaml\0",
        "case.yaml%00.html",
        "./case.yaml",
        "a/" * 600 + "case.yaml",
        "n" * 300 + ".yaml",
        "n" * 20_000 + ".yaml",
        "..\\secret.yaml",
        "\u2025/secret.yaml",
        "\ud800".encode("utf-8", "surrogatepass").decode("latin-1") + ".yaml",
    ],
)
def test_no_address_leads_out_of_the_folder(client, path):
    for page in ("/case", "/sliders", "/compare"):
        answer = client.get(page, params={"path": path, "a": path, "b": path})
        assert answer.status_code in (200, 414)
        for words in ("klack: secret", "root:", "Internal Server Error"):
            assert words not in answer.text
    for address in (f"/report?path={path}/report.html", f"/static/{path}", f"/sound/{path}"):
        answer = client.get(address.replace("\0", "%00").replace("\\", "%5C"))
        assert answer.status_code in (400, 404, 414)
        assert "klack: secret" not in answer.text


@pytest.mark.parametrize(
    "target",
    ["/static/../server.py", "/static/%2e%2e/server.py", "//etc/passwd", "/report/../case"],
)
def test_a_raw_path_leads_nowhere(server, client, target):
    """As it is sent, without a client that tidies it up."""
    with socket.create_connection(("127.0.0.1", port_of(server)), timeout=20) as connection:
        connection.sendall(
            f"GET {target} HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\n"
            f"Cookie: {cookie_of(client)}\r\nConnection: close\r\n\r\n".encode()
        )
        answer = b""
        while piece := connection.recv(65536):
            answer += piece
    assert answer.startswith(b"HTTP/1.1 404")


def test_a_wrong_cookie_opens_nothing(server, client):
    (name, value), *_ = client.cookies.items()
    wrong = (
        {name: value[:-1]},
        {name: value + "x"},
        {name: ""},
        {name.upper(): value},
        {"klack_1": value},
        {"token": value},
        {name: server.address.rpartition("=")[2]},  # the token is no cookie
    )
    for cookies in wrong:
        assert httpx.get(server.base, cookies=cookies).status_code == 403, cookies
    twice = httpx.get(server.base, headers={"cookie": f"{name}=no; {name}={value}"})
    assert twice.status_code in (200, 403)
    assert httpx.get(f"{server.base}/?token={value}").status_code == 403


def test_another_page_gets_no_socket_nor_a_foreign_name(server, client):
    """The handshake of a WebSocket, from another origin and by another name."""

    def shake(host: str, origin: str, cookie: str) -> bytes:
        with socket.create_connection(("127.0.0.1", port_of(server)), timeout=20) as connection:
            connection.sendall(
                f"GET /_nicegui_ws/socket.io/?EIO=4&transport=websocket HTTP/1.1\r\n"
                f"Host: {host}\r\nOrigin: {origin}\r\nCookie: {cookie}\r\n"
                "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
            )
            return connection.recv(4096).split(b"\r\n")[0]

    own, cookie = server.base.partition("//")[2], cookie_of(client)
    assert b" 101 " in shake(own, server.base, cookie)
    assert b" 403 " in shake(own, "http://evil.example", cookie)
    assert b" 403 " in shake(own, "null", cookie)
    assert b" 403 " in shake(own, server.base, "klack_1=x")
    evil = f"evil.example:{port_of(server)}"
    assert b" 101 " not in shake(evil, f"http://{evil}", cookie)


def test_nothing_that_lies_in_the_folder_runs_in_a_page(browser, server, folder):
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(LONG)
    said = watched(page, server.base)
    page.goto(server.address)
    page.get_by_text("case.yaml").first.wait_for()
    page.get_by_role("button", name="Note case.yaml", exact=True).click()
    page.get_by_role("textbox", name="note on case.yaml").fill(SCRIPT)
    page.get_by_role("button", name="Keep").click()
    page.locator(".k-note", has_text="onerror").wait_for()
    name = next(path.name for path in folder.glob("*script*.yaml"))
    for address in ("/", "/case?path=case.yaml", f"/case?path={name.replace('&', '%26')}"):
        page.goto(server.base + address)
        page.wait_for_selector(".k-error:not(:empty)")
        assert page.evaluate("window.attacked === undefined"), address
        assert page.locator("img").count() == 0
    flags = next(item for item in context.cookies() if item["name"].startswith("klack_"))
    assert flags["httpOnly"]
    assert flags["sameSite"] == "Strict"
    assert page.evaluate("document.cookie") == ""
    assert said == []
    context.close()


def test_a_file_of_a_hundred_megabytes_is_told_and_not_read(browser, server, folder):
    huge = folder / "huge.yaml"
    with huge.open("wb") as file:
        file.write(b"klack: 1\nx: ")
        file.truncate(100_000_000)
    page = browser.new_page()
    page.set_default_timeout(LONG)
    page.goto(server.address)
    page.locator(".k-row", has_text="100000000 bytes, expected at most 1000000").wait_for()
    page.get_by_role("button", name="Duplicate huge.yaml").click()
    page.locator(".q-notification", has_text="100000000 bytes").wait_for()
    huge.unlink()
    page.close()


def test_a_hostile_report_reaches_nothing(browser, server, folder):
    file = folder / "klack-results" / "a" / "report.html"
    file.write_text(HOSTILE.replace("ORIGIN", repr(server.base)))
    context = browser.new_context()
    page = context.new_page()
    page.goto(server.address)
    page.wait_for_selector("#k-body")
    page.goto(f"{server.base}/report?path=klack-results/a/report.html")
    page.wait_for_function("document.getElementById('told').textContent.startsWith('tried')")

    assert page.locator("#told").inner_text() == "tried:"
    assert page.url.endswith("report.html")  # the form led nowhere
    assert page.evaluate("window.origin") == "null"
    context.close()


def test_a_text_longer_than_is_taken_is_told_and_the_page_stays(browser, server, folder):
    """NiceGUI drops a message above 1 MB in the browser; nothing would be checked or kept."""
    (folder / "large.yaml").write_text("klack: 1\ntitle: x\n")
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(LONG)
    page.goto(server.address)
    page.wait_for_selector("#k-body")
    page.goto(f"{server.base}/case?path=large.yaml")
    page.wait_for_selector(".k-badge.out")
    said = watched(page, server.base)
    typed = (
        "count => { const e = document.getElementById('k-yaml');"
        "e.value = 'klack: 1\\ntitle: y\\n' + ('# ' + 'x'.repeat(998) + '\\n').repeat(count);"
        "}"
    )
    page.evaluate(typed, 1200)
    page.wait_for_selector("text=It is neither checked nor kept")
    page.evaluate(typed, 900)
    page.wait_for_selector("text=not valid, not saved")
    page.reload()
    page.wait_for_selector("text=not valid, not saved")
    assert page.evaluate("document.getElementById('k-yaml').value.length") > 900_000
    assert (folder / "large.yaml").read_text() == "klack: 1\ntitle: x\n"
    assert said == []
    context.close()
