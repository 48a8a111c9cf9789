"""Whatever a browser sends: controls keep values that a person could have chosen, and the page goes on."""

from __future__ import annotations

import math
import os
import random
import socket
import threading
import warnings
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
from ligature.cockpit.address import Address
from ligature.cockpit.gate import HEADERS, Gate
from ligature.cockpit.intake import check_input, placeable, rejections
from ligature.cockpit.page import serve
from viser._messages import Message
from websockets.exceptions import ConnectionClosed

from tests.cockpit.conftest import until
from tests.cockpit.test_gate import get, talk
from tests.cockpit.wired import plain

MESSAGES = 100_000 if os.environ.get("LIGATURE_EXAMPLES") == "new" else 3_000
OPTIONS = ("Step 1", "Step 10", "Step 100")
ODD = (
    None, True, False, 0, -1, 1, 3, 2**63, -(10**9), 0.5, 1e308, math.inf, -math.inf, math.nan, "", "abc", "Step 1",
    "Step 100000000000000000000", "1", "x" * 100_000, "\0", b"\xff", [], [1, 2], {}, {"value": 1},
)  # fmt: skip
PROPERTIES = ("value", "value", "value", "min", "max", "options", "visible", "removed", "uuid", "__class__", "label")


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    found = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), ""))
    yield found
    found.stop()


def controls(server: viser.ViserServer) -> dict[str, Any]:
    """One control of each kind that the page has, by the property that must hold of its value."""
    gui = server.gui
    return {
        "slider": gui.add_slider("s", -1.0, 1.0, 0.1, 0.0), "steps": gui.add_button_group("g", OPTIONS),
        "choice": gui.add_dropdown("d", OPTIONS), "text": gui.add_text("t", ""), "flag": gui.add_checkbox("c", False),
        "button": gui.add_button("b"),
    }  # fmt: skip


def sound(shown: dict[str, Any]) -> bool:
    """Whether every control has a value that a person could have chosen."""
    values = {name: control.value for name, control in shown.items()}
    return (
        -1.0 <= values["slider"] <= 1.0 and values["steps"] in OPTIONS and values["choice"] in OPTIONS
        and isinstance(values["text"], str) and len(values["text"]) <= 200
        and type(values["flag"]) is bool and type(values["button"]) is bool
    )  # fmt: skip


def update(uuid: Any, updates: Any) -> bytes:
    return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates})


def test_controls_keep_values_that_a_person_could_have_chosen(server: viser.ViserServer) -> None:
    shown, rng = controls(server), random.Random(5)
    uuids = [control._impl.uuid for control in shown.values()]
    before = rejections.count
    connection = talk(server.get_port())
    for _ in range(MESSAGES):
        names = rng.sample(PROPERTIES, rng.randint(1, 2))
        connection.send(update(rng.choice(uuids), {name: rng.choice(ODD) for name in names}))
    connection.send(update(uuids[3], {"value": "the last one"}))
    until(lambda: shown["text"].value == "the last one", "all messages are taken")
    assert rejections.count - before > MESSAGES // 2
    assert sound(shown), {name: control.value for name, control in shown.items()}
    connection.close()


CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 1.0), "fov": 0.8, "near": 0.01, "far": 10.0, "image_height": 8,
    "image_width": 12, "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, 1.0, 0.0),
}  # fmt: skip
UPLOAD = {"transfer_uuid": "t", "filename": "f", "mime_type": "m", "part_count": 10**6, "size_bytes": 10**12}


def packed(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


def test_what_the_page_does_not_offer_has_no_effect_and_stays_nowhere(
    server: viser.ViserServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown, asked = controls(server), list[str]()
    text = shown["text"]._impl.uuid
    monkeypatch.setattr(server, "request_share_url", lambda: asked.append("public"))
    monkeypatch.setattr(server, "disconnect_share_url", lambda: asked.append("private"))
    shown["button"].on_hold(lambda _: asked.append("held"), callback_hz=10.0)
    connection = talk(server.get_port())
    connection.send(packed("ViewerCameraMessage", **CAMERA))
    until(server.get_clients, "the browser is there")
    (client,) = server.get_clients().values()
    kept, before = len(server._websock_server._broadcast_buffer.message_from_id), rejections.count
    messages = [
        *(packed("GuiFormDirtyMessage", uuid=f"{i}" + 1000 * "x") for i in range(20)),
        packed("FileTransferStartUpload", source_component_uuid=text, **UPLOAD),
        *(
            packed("FileTransferPart", source_component_uuid=text, transfer_uuid="t", part_index=i, content=bytes(1000))
            for i in range(20)
        ),
        packed("ShareUrlRequest"),
        packed("ShareUrlDisconnect"),
        packed("GuiButtonHoldMessage", uuid=shown["button"]._impl.uuid, frequency=10.0),
        packed("GuiFormSubmitMessage", uuid=text),
        packed("CommandTriggerMessage", uuid=text),
    ]
    for message in messages:
        connection.send(message)
    connection.send(update(text, {"value": "the last one"}))
    until(lambda: shown["text"].value == "the last one", "all messages are taken")
    assert rejections.count - before == len(messages)
    assert not server.gui._current_file_upload_states and not client.gui._current_file_upload_states
    assert len(server._websock_server._broadcast_buffer.message_from_id) <= kept + 1  # the text's value
    assert asked == []
    connection.close()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("wxyz", (1.0, 0.0, 0.0)), ("wxyz", "abc"), ("wxyz", (math.nan, 0.0, 0.0, 0.0)), ("wxyz", (0.0, 0.0, 0.0, 0.0)),
        ("position", (0.0, math.inf, 0.0)), ("look_at", "ab"), ("up_direction", ()), ("fov", math.nan), ("near", -math.inf),
    ],
)  # fmt: skip
def test_nobody_looks_as_nobody_can(server: viser.ViserServer, field: str, value: Any) -> None:
    shown, connection = controls(server), talk(server.get_port())
    connection.send(packed("ViewerCameraMessage", **CAMERA))
    until(server.get_clients, "the browser is there")
    (client,) = server.get_clients().values()
    connection.send(packed("ViewerCameraMessage", **{**CAMERA, field: value}))
    connection.send(update(shown["flag"]._impl.uuid, {"value": True}))
    until(lambda: shown["flag"].value, "both are taken")
    assert client.camera.wxyz.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert client.camera.position.tolist() == [0.0, 0.0, 1.0]
    assert client.camera.fov == 0.8 and client.camera.near == 0.01
    connection.close()


def test_odd_numbers_are_neither_written_to_the_terminal_nor_kept() -> None:
    with warnings.catch_warnings(record=True) as written:
        check_input()
        Message.deserialize(packed("ViewerCameraMessage", **{**CAMERA, "wxyz": "\x1b[31m" + 1000 * "x"}))
    assert written == []


@pytest.mark.parametrize("value", [5, ["key"], {"key": 1}, 300 * "x"])
def test_a_browser_that_is_asked_for_a_key_gives_a_text_or_nothing(server: viser.ViserServer, value: Any) -> None:
    connection, given = talk(server.get_port()), list[Any]()
    connection.send(packed("ViewerCameraMessage", **CAMERA))
    until(server.get_clients, "the browser is there")
    (client,) = server.get_clients().values()

    def ask() -> None:
        given.append(client.local_storage.get_item("key", timeout=60.0))

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    request = asked_for(connection)
    for answer in (value, "a key"):
        connection.send(packed("LocalStorageGetItemResponseMessage", value=answer, error=None, request_uuid=request))
    thread.join(60.0)
    assert given == ["a key"]
    connection.close()


def asked_for(connection: Any) -> str:
    """The name of the request for a key that a browser is sent."""
    while True:
        for message in msgspec.msgpack.decode(plain(connection.recv(timeout=60.0)))["messages"]:
            if message["type"] == "LocalStorageGetItemRequestMessage":
                return str(message["request_uuid"])


@pytest.mark.parametrize("junk", [b"", b"\xc1", b"\xff" * 100, b"\x93\x01\x02\x03", b'{"type": 3}', b"x" * 2_000_000])
def test_junk_ends_its_connection_and_no_other(
    server: viser.ViserServer, junk: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    shown = controls(server)
    good, bad = talk(server.get_port()), talk(server.get_port())
    bad.send(junk)
    with pytest.raises(ConnectionClosed):
        while True:
            bad.recv(timeout=20.0)
    good.send(update(shown["flag"]._impl.uuid, {"value": True}))
    until(lambda: shown["flag"].value, "the other browser is heard")
    assert "Traceback" not in capfd.readouterr().err
    good.close()


def test_a_gizmo_goes_where_it_can_be_dragged_only() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        q = rng.normal(size=4)
        assert placeable(rng.uniform(-2, 2, 3).tolist(), (q / np.linalg.norm(q)).tolist())
    for position in ((0, 0), (0, 0, math.nan), (0, 0, 1e9), "abc", None, ("a", "b", "c"), 3):
        assert not placeable(position, (1, 0, 0, 0))
    for quaternion in ((0, 0, 0, 0), (1, 0, 0), (math.inf, 0, 0, 0), None, {"w": 1}, (10**400, 0, 0, 0)):
        assert not placeable((0, 0, 0), quaternion)


def test_no_other_page_shows_this_one(server: viser.ViserServer) -> None:
    for path, host in (("/", f"127.0.0.1:{server.get_port()}"), ("/", "example.org"), ("/index.html", "localhost")):
        _, _, headers = get(server.get_port(), path, Host=host)
        assert {name: headers.get(name) for name in HEADERS} == HEADERS


@pytest.mark.parametrize(
    "request_",
    [
        "GET / HTTP/1.1\r\nHost: [::1\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n",
        "GET / HTTP/1.1\r\n\r\n",
        f"GET /{'a' * 5000} HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "GET //[::1?token=1 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://[::1\r\n\r\n",
    ],
)
def test_odd_requests_are_answered_as_such(server: viser.ViserServer, request_: str) -> None:
    with socket.create_connection(("127.0.0.1", server.get_port()), timeout=20.0) as connection:
        connection.sendall(request_.encode())
        status = connection.recv(4096).split(b" ")[1]
    assert status in (b"400", b"403", b"404"), status
    assert get(server.get_port(), Host="localhost")[0] == 200
