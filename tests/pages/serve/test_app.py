"""The requests of a page, and which requests are refused."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from PIL import Image

import warpsplat
from tests.pages.serve.helpers import Visitor, held, picture, until
from warpsplat.fit.settings import make_settings
from warpsplat.pages.serve.runs import Limits
from warpsplat.run.formats import missing, named_bytes
from warpsplat.run.options import preset_names

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
    answer = visitor.client.get(visitor.at("runs", run["id"], "result.svg"))
    assert answer.text == made.svg
    assert run["figures"]["bytes"] == len(made.svg) and run["figures"]["shapes"] == len(made.scene)
    assert run["figures"]["psnr"] == made.as_dict()["psnr"]
    assert run["command"] == "warpsplat vectorize 'my photo.png' --curves 4 --subject photo -o 'my photo.svg'"


def test_the_command_has_the_settings_of_the_form() -> None:
    with Visitor(max_memory="2GB") as visitor:
        run = visitor.begin(
            visitor.upload(picture(), "-a b.png"),
            colors=6,
            kind="mixed",
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


def test_runs_are_queued_and_a_new_one_replaces_what_is_not_over(visitor: Visitor) -> None:
    image, other = visitor.upload(picture()), visitor.upload(picture(), "other.png")
    first = visitor.begin(image, quality="high", **SHORT)
    until(lambda: visitor.run(first)["state"] == "running")
    second = visitor.begin(other, **SHORT)
    assert visitor.run(second)["place"] == 1
    third, fourth = (visitor.begin(image, **SHORT) for _ in range(2))
    assert {run["id"] for run in visitor.state()["runs"]} >= {second, fourth}
    assert not {run["id"] for run in visitor.state()["runs"]} & {first, third}
    assert visitor.over(second)["state"] == visitor.over(fourth)["state"] == "done"
    visitor.over(visitor.begin(image, **SHORT))
    assert fourth in {run["id"] for run in visitor.state()["runs"]}  # a result stays


def test_a_draft_is_shown_first(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    stops: list[bool] = []
    vectorize = warpsplat.vectorize

    def noted(*given: Any, **named: Any) -> Any:
        asked.append(named["settings"])
        result = vectorize(*given, **named)
        for told in visitor.state()["runs"] if stops else ():
            visitor.store.stop_run(told["id"])
        return result

    monkeypatch.setattr("warpsplat.pages.serve.worker.warpsplat.vectorize", noted)
    image = visitor.upload(picture())
    settings = {"curves": 4, "subject": "photo", "quality": "high"}
    run = visitor.begin(image, **settings)
    told = until(
        lambda: (live := visitor.run(run).get("live")) and live["pictures"] and not live["draft"] and live
    )
    assert told["pictures"] >= 1
    draft = visitor.client.get(visitor.at("runs", run, "live.svg")).text
    assert asked == [make_settings(**{**settings, "quality": "draft"}), make_settings(**settings)]
    visitor.client.delete(visitor.at("runs", run))
    stops.append(True)  # what there is by then is kept
    run = visitor.begin(image, **settings)
    assert visitor.over(run)["state"] == "stopped" and len(asked) == 3
    assert visitor.client.get(visitor.at("runs", run, "result.svg")).text == draft


@pytest.mark.skipif(not preset_names(), reason="the extension batch has them")
def test_presets(visitor: Visitor) -> None:
    """The command names one, and the file is that of the command."""
    run = visitor.begin(visitor.upload(picture()), preset="brush", curves=3)
    command = visitor.over(run)["command"]
    assert command == "warpsplat vectorize photo.png --preset brush --curves 3 -o photo.svg"
    made = warpsplat.vectorize(picture(), preset="brush", curves=3, device="cpu", threads=1)
    assert visitor.client.get(visitor.at("runs", run, "result.svg")).text == made.svg


def test_formats_of_saved_results(visitor: Visitor, monkeypatch: pytest.MonkeyPatch) -> None:
    run = visitor.over(visitor.begin(visitor.upload(picture()), **SHORT))["id"]
    svg = visitor.client.get(visitor.at("runs", run, "result.svg")).text

    def saved(file: str) -> httpx.Response:
        return visitor.client.get(visitor.at("runs", run, file))

    assert saved("result.png").content == named_bytes(Path("x.png"), svg)
    assert saved("result.eps").content.startswith(b"%!PS")
    if not missing(Path("x.dxf")):
        assert saved("result.dxf").content == named_bytes(Path("x.dxf"), svg)
    report = saved("report.html")
    assert report.text.startswith("<!doctype html>") and ">photo.png</span>" in report.text
    assert report.headers["content-type"] == "application/octet-stream"  # it is never a page of this server
    for unknown in ("result.html", "result.svgz", "result."):
        assert saved(unknown).status_code == 404
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    answer = saved("result.dxf")
    assert answer.status_code == 400
    assert one_line(answer.text).startswith(
        "photo.dxf: DXFs need a package that is not installed: pip install "
    )


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"curves": "many"}, "curves must be a whole number from 1 to 100000, not 'many'"),
        ({"subject": "drawing", "kind": "open"}, "subject drawing and open cannot be combined"),
        ({"kind": "both"}, "kind must be one of closed, open, mixed, not 'both'"),
        ({"preset": "/etc/presets.yaml"}, "there is no preset '/etc/presets.yaml'"),
        ({"preset": ["brush"]}, "there is no preset ['brush']"),
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
        "/assets/serve.js",
        "/images/..%2f..%2fpasswd",
        "/runs/none/result.svg",
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
    assert (told["width"], told["height"]) == (20, 30)


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
        answer = client.post("/runs", headers=headers)
        assert (
            answer.status_code == 403 and one_line(answer.text) == "requests from other pages are not allowed"
        )
    origin = visitor.server.address().partition("/?")[0]
    assert client.post("/runs", headers={"origin": origin}).status_code == 400
    client.cookies.clear()
    elsewhere = visitor.server.address().replace("/?", "/events?")
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
