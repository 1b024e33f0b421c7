"""Who is let in: hosts, origins and lengths of every kind end in an answer."""

import asyncio

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchcore.asgi.guard import LARGEST, Guard


def status(headers, hosts=("127.0.0.1",)):
    """What a request with these headers is answered by; 200 from behind the guard."""
    sent = []

    async def behind(scope, receive, send):
        await receive()
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def receive():
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message):
        sent.append(message)

    scope = {"type": "http", "headers": [(name.encode(), value) for name, value in headers.items()]}
    asyncio.run(Guard(behind, hosts)(scope, receive, send))
    return sent[0]["status"]


HERE = b"127.0.0.1:8020"


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({"host": HERE}, 200),
        ({"host": b"127.0.0.1"}, 200),
        ({"host": HERE, "origin": b"http://127.0.0.1:8020"}, 200),
        ({"host": HERE, "content-length": str(LARGEST).encode()}, 200),
        ({}, 403),
        ({"host": b"example.org"}, 403),
        ({"host": HERE, "origin": b"http://example.org"}, 403),
        ({"host": HERE, "origin": b"null"}, 403),
        ({"host": b"["}, 400),
        ({"host": HERE, "origin": b"http://["}, 400),
        ({"host": HERE, "content-length": str(LARGEST + 1).encode()}, 413),
        ({"host": HERE, "content-length": "²".encode("latin-1")}, 413),
        ({"host": HERE, "content-length": b"-1"}, 413),
        ({"host": HERE, "content-length": b"9" * 5000}, 413),
    ],
)
def test_a_request_is_let_in_or_told_why_not(headers, expected):
    assert status(headers) == expected


@given(st.binary(max_size=40), st.binary(max_size=40), st.binary(max_size=40))
def test_whatever_the_headers_say_there_is_an_answer(host, origin, length):
    assert status({"host": host, "origin": origin, "content-length": length}) in (200, 400, 403, 413)
