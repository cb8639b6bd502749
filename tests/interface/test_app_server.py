"""The whole server as a process: what it answers, what it refuses, how it ends."""

import re
import signal
from pathlib import Path

import pytest
from app_browser import LONG, client, server
from served_app import Served

httpx = pytest.importorskip("httpx")
pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow  # a server starts

__all__ = ["client", "server"]  # fixtures

ATTACK = "</script><script>alert(1)</script>`${alert(2)}`"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("app")
    (place / "cases").mkdir()
    (place / "secret.html").write_text("secret")
    (place / "cases" / "report.html").symlink_to(place / "secret.html")
    result = place / "cases" / "klack-results" / "a"
    (result / "result.zarr").mkdir(parents=True)
    (result / "report.html").write_text("<script>parent.alert(1)</script>")
    (place / "cases" / f"{ATTACK.replace('/', '')}.yaml").write_text(f"klack: 1\ntitle: {ATTACK}\n")
    return place / "cases"


def test_it_listens_on_this_machine_alone_with_a_token(server):
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{43}", server.address)
    assert httpx.get(server.base).status_code == 403


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "/case?path=x",
        "/sliders?path=x",
        "/compare?a=x&b=y",
        "/points?path=x",
        "/new-study?path=x",
    ],
)
def test_pages_name_no_other_host_in_what_they_load(client, path):
    page = client.get(path)

    assert page.status_code == 200
    assert "default-src 'none'" in page.headers["content-security-policy"]
    assert re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?(https?:)?//""", page.text) == []


def test_scripts_in_names_and_addresses_stay_text(client):
    name = f"{ATTACK.replace('/', '')}.yaml"
    for path in (ATTACK, name):
        for page in ("/case", "/sliders", "/compare", "/points", "/new-study"):
            answer = client.get(page, params={"path": path, "a": path, "b": path})
            assert answer.status_code == 200
            assert "<script>alert" not in answer.text
            assert "`${alert" not in answer.text


def test_the_numbers_of_a_study_are_no_page(client):
    answer = client.get("/points-data", params={"path": ATTACK})

    assert answer.headers["content-type"] == "application/json"
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert "no study" in answer.json()["error"]


def test_reports_run_apart_from_the_application(client):
    answer = client.get("/report", params={"path": "klack-results/a/report.html"})
    policy = answer.headers["content-security-policy"]

    assert answer.status_code == 200
    assert "sandbox allow-scripts" in policy
    assert "allow-same-origin" not in policy
    assert "connect-src" not in policy  # default-src 'none' holds
    assert "default-src 'none'" in policy


@pytest.mark.parametrize(
    "path",
    [
        "../secret.html",
        "report.html",  # a link that leads out
        "klack-results/../../report.html",
        "/etc/passwd",
        "klack-results/a/result.zarr/zarr.json",
        "",
    ],
)
def test_no_file_outside_and_nothing_but_reports(client, path):
    answer = client.get("/report", params={"path": path})

    assert answer.status_code == 404
    assert "secret" not in answer.text.replace("secret.html", "")


def test_what_is_not_there_is_told_so(client):
    assert client.get("/sound/none.wav").status_code == 404
    assert client.get("/static/../server.py").status_code == 404
    assert client.get("/static/klack.css").headers["content-type"].startswith("text/css")
    for path in ("/docs", "/openapi.json", "/redoc", "/nowhere/<b>", "/report?path=a/report.html"):
        answer = client.get(path)
        assert answer.status_code == 404
        assert "Back to cases and results" in answer.text
        assert "<b>" not in answer.text


def test_a_huge_body_is_refused(client, server):
    own = {"origin": server.base}
    answer = client.post("/_nicegui_ws/socket.io/", headers=own, content=b"x" * (4 * 2**20 + 1))

    assert answer.status_code == 413


def test_another_origin_gets_no_socket(client):
    answer = client.get(
        "/_nicegui_ws/socket.io/?EIO=4&transport=polling",
        headers={"origin": "http://evil.example"},
    )

    assert answer.status_code == 403


def test_it_ends_when_it_is_interrupted(tmp_path):
    with Served(tmp_path) as own:
        own.process.send_signal(signal.SIGINT)

        assert own.process.wait(LONG / 1e3) in (0, 130)
