"""The lock as it stands in front of a served workbench, seen from outside."""

import contextlib
import http.client
import json

import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

KEY = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
       "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}  # fmt: skip
SOCKET = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"


def asked(served, path, headers=None, *, host=None, method="GET", body=None):
    """Status and body of what the server answers."""
    line = http.client.HTTPConnection("127.0.0.1", served.port, timeout=60)
    try:
        line.putrequest(method, path, skip_host=True)
        line.putheader("Host", host or f"127.0.0.1:{served.port}")
        for name, value in (headers or {}).items():
            line.putheader(name, value)
        if body is not None:
            line.putheader("Content-Length", str(len(body)))
        line.endheaders()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            line.send(body or b"")  # it may be refused before it is all sent
        answer = line.getresponse()
        return answer.status, b"" if answer.status == 101 else answer.read()
    finally:
        line.close()


def test_only_loopback_is_listened_to(served):
    assert served.url.startswith("http://127.0.0.1:")


@pytest.mark.parametrize("path", ["/", "/analyse", "/run", "/static/workbench.css", SOCKET,
                                  "/files/plan.toml", "/wrong/analyse"])  # fmt: skip
def test_nothing_is_answered_without_the_token(served, path):
    assert asked(served, path)[0] == 403


def test_a_foreign_origin_and_a_rebound_host_are_refused_on_pages_and_sockets(served):
    root, own = f"/{served.token}", f"http://127.0.0.1:{served.port}"
    assert asked(served, f"{root}/analyse", {"Origin": own})[0] in (200, 303)
    assert asked(served, f"{root}{SOCKET}", {**KEY, "Origin": own})[0] == 101
    for origin in ("http://evil.test", "null", f"http://127.0.0.1:{served.port + 1}"):
        assert asked(served, f"{root}/analyse", {"Origin": origin})[0] == 403
        assert asked(served, f"{root}{SOCKET}", {**KEY, "Origin": origin})[0] == 403
    assert asked(served, f"{root}{SOCKET}", KEY)[0] == 403
    for host in ("evil.test", f"evil.test:{served.port}", "127.0.0.1"):
        assert asked(served, f"{root}/analyse", host=host)[0] == 403
        assert asked(served, f"{root}{SOCKET}", {**KEY, "Origin": own}, host=host)[0] == 403


def test_a_body_beyond_the_size_is_refused(served):
    status, said = asked(served, f"/{served.token}/analyse", method="POST", body=b"0" * 1_100_000)
    assert (status, b"more than 1 MB" in said) == (413, True)


def test_files_are_handed_out_from_the_folder_of_the_runs_alone(served):
    (served.runs / "a.json").write_text(json.dumps({"a": 1}))
    root = f"/{served.token}/files"
    assert asked(served, f"{root}/a.json") == (200, b'{"a": 1}')
    (served.runs.parent / "secret.txt").write_text("secret")
    for path in ("../secret.txt", "%2e%2e/secret.txt", "..%2fsecret.txt", "/etc/passwd"):
        assert asked(served, f"{root}/{path}")[0] == 404


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--port", "70000"], "--port 70000 is no port"),
        (["--max-upload", "0"], "--max-upload 0 MB takes nothing"),
        (["--grace", "0"], "--grace 0 s"),
        (["--rig-file", "nowhere.toml"], "'nowhere.toml' cannot be read"),
    ],
)
def test_bad_options_are_one_line(tmp_path, monkeypatch, arguments, reason):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["workbench", "--no-browser", *arguments])
    assert done.exit_code == 2
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
