"""The lock: who may not pass, and what may not come in."""

import asyncio
from contextlib import nullcontext

import pytest

from hmpim.workbench.lock import Lock
from tests_support import finished

TOKEN = "aT0ken_of-the-tests"
HOST = (b"host", b"127.0.0.1:8080")
OWN = (b"origin", b"http://127.0.0.1:8080")


def asked(*headers, path=f"/{TOKEN}/analyse", kind="http"):
    return {"type": kind, "path": path, "headers": list(headers)}


async def echoing(scope, receive, send):
    """An application that reads all that comes, and answers with its length."""
    size, more = 0, True
    while more:
        message = await receive()
        size += len(message.get("body", b""))
        more = message.get("more_body", False)
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send(
        {"type": "http.response.body", "body": b"%d %s" % (size, scope["root_path"].encode())}
    )


def answered(lock, scope, bodies=(b"",)):
    """Status, headers and body of what a lock answers."""
    waiting = [
        {"type": "http.request", "body": body, "more_body": k < len(bodies) - 1}
        for k, body in enumerate(bodies)
    ]
    read, sent = [], []

    async def receive():
        read.append(1)
        return waiting.pop(0)

    async def send(message):
        sent.append(message)

    finished(lock(scope, receive, send))
    body = b"".join(m.get("body", b"") for m in sent)
    return sent[0].get("status", sent[0].get("code")), dict(sent[0].get("headers", ())), body, read


LOCK = Lock(echoing, token=TOKEN, port=8080, largest=1000)


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("headers", "path", "reason"),
    [
        ((HOST, OWN), f"/{TOKEN}/", ""),
        (((b"host", b"localhost:8080"), (b"origin", b"http://localhost:8080")), f"/{TOKEN}/", ""),
        ((HOST, OWN), "/", "lacks its token"),
        ((HOST, OWN), "/analyse", "lacks its token"),
        ((HOST, OWN), f"/{TOKEN[:-1]}/", "lacks its token"),
        ((HOST, OWN), f"/{TOKEN}x/", "lacks its token"),
        ((HOST, OWN), f"/x/{TOKEN}/", "lacks its token"),
        (((b"host", b"evil.test:8080"), OWN), f"/{TOKEN}/", "not called evil.test"),
        (((b"host", b"127.0.0.1:8081"), OWN), f"/{TOKEN}/", "not called 127.0.0.1:8081"),
        ((OWN,), f"/{TOKEN}/", "not called nothing"),
        ((HOST, HOST, OWN), f"/{TOKEN}/", "not called"),
        ((HOST, (b"origin", b"https://evil.test")), f"/{TOKEN}/", "pages of https://evil.test"),
        ((HOST, (b"origin", b"null")), f"/{TOKEN}/", "pages of null"),
        ((HOST, (b"origin", b"http://127.0.0.1:9999")), f"/{TOKEN}/", "pages of http://127.0.0.1"),
        ((HOST, OWN, (b"sec-fetch-site", b"cross-site")), f"/{TOKEN}/", "pages of other servers"),
        ((HOST, OWN, (b"sec-fetch-site", b"same-site")), f"/{TOKEN}/", "pages of other servers"),
    ],
)
def test_only_who_knows_the_token_and_comes_from_here_may_pass(kind, headers, path, reason):
    found = LOCK.reason(asked(*headers, path=path, kind=kind))
    assert reason in found
    assert bool(reason) == bool(found)


def test_a_socket_needs_an_origin_and_a_person_who_types_the_address_has_none():
    assert LOCK.reason(asked(HOST, kind="http")) == ""
    assert "socket" in LOCK.reason(asked(HOST, kind="websocket"))


def test_what_is_refused_never_reaches_the_application():
    status, headers, body, read = answered(LOCK, asked(HOST, path="/wrong/"))
    assert (status, read) == (403, [])
    assert b"lacks its token" in body
    assert headers[b"x-frame-options"] == b"DENY"
    assert answered(LOCK, asked(HOST, kind="websocket"))[0] == 1008


def test_the_application_sees_the_token_as_its_root_and_pages_may_not_be_framed():
    status, headers, body, _ = answered(LOCK, asked(HOST, OWN))
    assert (status, body) == (200, f"0 /{TOKEN}".encode())
    assert b"frame-ancestors 'none'" in headers[b"content-security-policy"]
    assert headers[b"referrer-policy"] == b"no-referrer"


def test_too_much_is_cut_off_while_it_comes_whatever_the_header_says():
    status, _, body, read = answered(LOCK, asked(HOST, OWN), [b"x" * 400] * 100)
    assert (status, len(read)) == (413, 3)
    assert b"more than 0.001 MB" in body
    lying = (b"content-length", b"10")
    assert answered(LOCK, asked(HOST, OWN, lying), [b"x" * 600] * 2)[0] == 413
    honest = (b"content-length", b"5000")
    assert answered(LOCK, asked(HOST, OWN, honest), [b"x" * 600])[::3] == (413, [])
    assert answered(LOCK, asked(HOST, OWN), [b"x" * 500] * 2)[0] == 200


def test_a_browser_that_goes_away_is_no_defect_and_a_defect_is_one():
    async def left(scope, receive, send):
        raise RuntimeError("No response returned.")  # as Starlette says it

    async def broken(scope, receive, send):
        raise RuntimeError("a defect")

    async def closed():
        return {"type": "http.disconnect"}

    async def open_still():
        await asyncio.Event().wait()

    async def send(message):
        raise AssertionError(message)

    for application, receive, defect in ((left, closed, False), (broken, open_still, True)):
        lock = Lock(application, token=TOKEN, port=8080, largest=1000)
        with pytest.raises(RuntimeError, match="a defect") if defect else nullcontext():
            finished(lock(asked(HOST, OWN), receive, send))


def test_a_damaged_length_is_refused_and_no_defect():
    assert answered(LOCK, asked(HOST, OWN, (b"content-length", b"ten")))[0] == 400
