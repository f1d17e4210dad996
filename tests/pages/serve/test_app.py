"""The requests of a page, and which requests are refused."""

from __future__ import annotations

import gc
import io
import weakref
from collections.abc import Iterator
from typing import Any

import pytest
from PIL import Image

import warpsplat
from tests.pages.serve.helpers import Visitor, held, picture, until
from warpsplat.fit.settings import make_settings
from warpsplat.pages.serve.sessions import Limits
from warpsplat.rendering.parameters import Parameters

SHORT = {"curves": 4, "subject": "photo"}


def one_line(text: str) -> str:
    assert text.endswith("\n") and text.count("\n") == 1
    return text.strip()


def test_an_image_becomes_the_file_of_the_command_line(visitor: Visitor) -> None:
    data = picture()
    image = visitor.upload(data, "my photo.png")
    (told,) = visitor.state()["images"]
    assert (told["id"], told["name"], told["width"], told["height"]) == (image, "my photo.png", 40, 32)
    run = visitor.over(visitor.begin(image, **SHORT))
    assert run["state"] == "done" and run["error"] == ""
    made = warpsplat.vectorize(
        data, settings=make_settings(curves=4, subject="photo"), device="cpu", threads=1
    )
    answer = visitor.client.get(visitor.at("runs", run["id"], "result.svg?download"))
    assert answer.text == made.svg
    assert answer.headers["content-disposition"] == "attachment; filename*=UTF-8''my%20photo.svg"
    assert run["figures"]["bytes"] == len(made.svg) and run["figures"]["shapes"] == len(made.scene)
    assert run["figures"]["psnr"] == made.as_dict()["psnr"]
    assert run["command"] == "warpsplat vectorize 'my photo.png' --curves 4 --subject photo -o 'my photo.svg'"


def test_the_command_has_the_settings_of_the_form() -> None:
    with Visitor(max_memory="2GB") as visitor:
        run = visitor.begin(
            visitor.upload(picture(), "-a b.png"),
            colors=6,
            open=False,
            mixed=True,
            quality="high",
            **{"max-bytes": "9KB"},
        )
        assert visitor.run(run)["command"] == (
            "warpsplat vectorize './-a b.png' --quality high --mixed --colors 6 --max-bytes 9000"
            " --max-memory 2000000000 -o './-a b.svg'"
        )


def test_a_run_that_is_stopped_has_a_file(visitor: Visitor) -> None:
    image = visitor.upload(picture())
    run = visitor.begin(image, quality="high", **SHORT)
    until(lambda: visitor.run(run).get("live", {}).get("work"))
    assert visitor.client.post(visitor.at("runs", run, "stop")).status_code == 204
    told = visitor.over(run)
    assert told["state"] == "stopped" and told["figures"]["psnr"] > 5
    svg = visitor.client.get(visitor.at("runs", run, "result.svg")).text
    assert warpsplat.load_svg(svg).canvas.width == 40
    assert warpsplat.score(svg, picture()).psnr == pytest.approx(told["figures"]["psnr"], abs=0.01)


def test_runs_are_queued() -> None:
    with Visitor(Limits(waiting=2)) as visitor:
        image = visitor.upload(picture())
        first = visitor.begin(image, quality="high", **SHORT)
        until(lambda: visitor.run(first)["state"] == "running")
        second, third = (visitor.begin(image, **SHORT) for _ in range(2))
        assert [visitor.run(run)["place"] for run in (second, third)] == [1, 2]
        answer = visitor.start(image, **SHORT)
        assert (answer.status_code, answer.headers["retry-after"]) == (429, "5")
        assert one_line(answer.text) == "2 runs are waiting: try again when one is done"
        visitor.client.post(visitor.at("runs", second, "stop"))  # leaves the queue
        assert [run["id"] for run in visitor.state()["runs"]] == [first, third]
        visitor.client.post(visitor.at("runs", first, "stop"))
        assert visitor.over(third)["state"] == "done" and visitor.run(first)["state"] == "stopped"


def test_a_run_leaves_only_its_file(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays are freed when it is over, the image when it is removed, without collecting cycles."""
    arrays: list[weakref.ref[object]] = []
    create = Parameters.__init__

    def noted(self: Parameters, *given: Any, **named: Any) -> None:
        arrays.append(weakref.ref(self))
        create(self, *given, **named)

    monkeypatch.setattr(Parameters, "__init__", noted)
    gc.collect()
    gc.disable()
    try:
        image = visitor.upload(picture())
        run = visitor.over(visitor.begin(image, **SHORT))
        held = [weakref.ref(visitor.store.upload(visitor.session, image))]
        held.append(weakref.ref(visitor.store.run(visitor.session, run["id"])))
        assert arrays
        until(lambda: not [each for each in arrays if each()])
        assert visitor.client.delete(visitor.at("images", image)).status_code == 204
        until(lambda: not [each for each in held if each()])
    finally:
        gc.enable()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"curves": "many"}, "curves must be a whole number from 1 to 100000, not 'many'"),
        ({"subject": "drawing", "open": True}, "subject drawing and open cannot be combined"),
        ({"closed": True, "open": True}, "closed and open cannot be combined"),
        ({"max-bytes": "9Q"}, "not a size: '9Q'"),
        ({"shape": "cirkle"}, "shape must be one of "),
        ({"palette": "/etc/passwd"}, "unknown setting 'palette'; there are "),
    ],
)
def test_invalid_settings(visitor: Visitor, settings: dict[str, object], said: str) -> None:
    answer = visitor.start(visitor.upload(picture()), **settings)
    assert answer.status_code == 400 and one_line(answer.text).startswith(said)


@pytest.mark.parametrize(
    ("data", "status", "said"),
    [
        (b"no image at all\n", 415, "photo.png: not an image of a format that is read: AVIF, "),
        (b"", 415, "photo.png: the file is empty"),
        (picture()[:90], 415, "photo.png: damaged or unsupported image: "),
        (bytes(2_000_001), 413, "photo.png: has 2.0 MB; the limit is 2 MB"),
    ],
)
def test_an_invalid_upload(data: bytes, status: int, said: str) -> None:
    with Visitor(Limits(upload=2_000_000)) as visitor:
        answer = visitor.client.post(visitor.at("images?name=photo.png"), content=data)
        assert answer.status_code == status and one_line(answer.text).startswith(said)
        assert held(visitor.store)["uploading"] == held(visitor.store)["images"] == 0


def test_requests_of_unknown_or_excessive_size(visitor: Visitor) -> None:
    def parts() -> Iterator[bytes]:
        yield bytes(10)

    assert visitor.client.post(visitor.at("images"), content=parts()).status_code == 411
    many = b'{"image": "' + bytes(30_000) + b'"}'
    answer = visitor.client.post(visitor.at("runs"), content=many)
    assert answer.status_code == 413 and one_line(answer.text) == "the request: more than 0.02 MB"
    assert visitor.client.post(visitor.at("runs"), content=b"[1]").status_code == 400


@pytest.mark.parametrize(
    "path",
    [
        "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2fetc%2fpasswd",
        "/sessions/..%2f..%2f..%2fetc%2fpasswd/events",
        "/assets/serve.js",
        "/sessions/none/images/..%2f..%2fpasswd",
        "/sessions/none/runs/none/result.svg",
    ],
)
def test_paths_outside(visitor: Visitor, path: str) -> None:
    answer = visitor.client.get(path)
    assert answer.status_code == 404 and "root:" not in one_line(answer.text)


def test_the_picture_of_an_image_is_encoded_here(visitor: Visitor) -> None:
    """It is upright and keeps its opacity, but nothing else of the file."""
    pixels = Image.new("RGBA", (30, 20), (200, 10, 10, 128))
    exif = Image.Exif()
    exif[0x0112] = 6
    buffer = io.BytesIO()
    pixels.save(buffer, "PNG", exif=exif)
    image = visitor.upload(buffer.getvalue() + b"<script>")
    answer = visitor.client.get(visitor.at("images", image))
    assert answer.headers["content-type"] == "image/png" and b"<script>" not in answer.content
    with Image.open(io.BytesIO(answer.content)) as shown:
        assert shown.size == (20, 30) and shown.getpixel((3, 3)) == (200, 10, 10, 128)
    (told,) = visitor.state()["images"]
    assert (told["width"], told["height"], told["transparent"]) == (20, 30, True)


def test_headers(visitor: Visitor) -> None:
    run = visitor.over(visitor.begin(visitor.upload(picture()), **SHORT))
    for path in ("/", visitor.at("runs", run["id"], "result.svg"), "/nothing"):
        headers = visitor.client.get(path).headers
        assert headers["x-content-type-options"] == "nosniff" and headers["x-frame-options"] == "DENY"
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert "access-control-allow-origin" not in headers
    headers = visitor.client.get(visitor.at("runs", run["id"], "result.svg")).headers
    policy = headers["content-security-policy"]
    assert "sandbox" in policy and "default-src 'none'" in policy


def test_requests_that_are_not_authorised(visitor: Visitor) -> None:
    client = visitor.client
    for host in ("evil.example:8765", "evil.example", "[bad", ""):
        answer = client.get("/", headers={"host": host})
        assert answer.status_code == 403 and one_line(answer.text).startswith(
            "this server does not answer to the name"
        )
    for host in ("localhost:9000", "127.0.0.1", "[::1]:8765"):  # as through a tunnel, without the cookie
        answer = client.get("/", headers={"host": host})
        assert one_line(answer.text) == "open the address that warpsplat serve printed: it contains a token"
    for headers in ({"origin": "http://evil.example"}, {"origin": "null"}, {"sec-fetch-site": "cross-site"}):
        answer = client.post("/sessions", headers=headers)
        assert (
            answer.status_code == 403 and one_line(answer.text) == "requests from other pages are not allowed"
        )
    origin = visitor.server.address().partition("/?")[0]
    assert client.post("/sessions", headers={"origin": origin}).status_code == 201
    client.cookies.clear()
    elsewhere = visitor.server.address().replace("/?", "/sessions?")
    for path in ("/", "/?token=wrong", visitor.at("events"), elsewhere):
        assert client.get(path).status_code == 403


def test_a_token_becomes_a_cookie_and_a_ticket_can_be_used_once(visitor: Visitor) -> None:
    client, address = visitor.client, visitor.server.ticket()
    client.cookies.clear()
    answer = client.get(address)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie and "SameSite=strict" in cookie and address.rpartition("=")[2] not in cookie
    assert client.get("/").status_code == 200
    client.cookies.clear()
    assert client.get(address).status_code == 403


def test_an_internal_error_is_one_line(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("oh\nno")

    monkeypatch.setattr("warpsplat.pages.serve.app.read_upload", broken)
    answer = visitor.client.post(visitor.at("images"), content=picture())
    assert answer.status_code == 500
    assert one_line(answer.text).startswith("internal error: RuntimeError: oh (set")


def test_the_next_run_goes_on_after_one_that_fails(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    image = visitor.upload(picture())
    with monkeypatch.context() as patch:
        patch.setattr("warpsplat.pages.serve.worker.warpsplat.vectorize", lambda *_, **__: 1 / 0)
        failed = visitor.over(visitor.begin(image))
        assert failed["state"] == "failed" and "division by zero" in failed["error"]
        assert visitor.client.get(visitor.at("runs", failed["id"], "result.svg")).status_code == 404
    assert visitor.over(visitor.begin(image, **SHORT))["state"] == "done"
