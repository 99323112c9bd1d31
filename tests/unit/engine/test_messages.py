"""Messages over a connection arrive whole, and nothing else passes for one."""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pytest_drive_robust.domain.episode import Episode
from pytest_drive_robust.engine.messages import (
    TOKEN_BYTES,
    WorkerRequest,
    answer_bytes,
    read_answer,
    receive,
    refusal,
)
from pytest_drive_robust.errors import UnknownNameError, UsageError
from pytest_drive_robust.registry.registry import Registry
from pytest_drive_robust.testing import fake_route

TOKEN = b"t" * TOKEN_BYTES
MESSAGE = (TOKEN, b"what was driven")
MESSAGES = st.tuples(st.binary(min_size=TOKEN_BYTES, max_size=TOKEN_BYTES), st.binary(max_size=300))


@pytest.fixture
def ends() -> Iterator[tuple[Connection, Connection]]:
    ours, theirs = Pipe()
    with ours, theirs:
        yield ours, theirs


@settings(suppress_health_check=list(HealthCheck))
@given(messages=st.lists(MESSAGES, max_size=4))
def test_messages_arrive_whole_and_in_order(
    ends: tuple[Connection, Connection], messages: list[tuple[bytes, bytes]]
) -> None:
    ours, theirs = ends
    for message in messages:
        ours.send_bytes(b"".join(message))
    assert [receive(theirs) for _ in messages] == messages


def test_a_connection_that_ends_between_messages_is_at_its_end(ends: tuple[Connection, Connection]) -> None:
    ours, theirs = ends
    ours.send_bytes(b"".join(MESSAGE))
    ours.close()
    assert receive(theirs) == MESSAGE
    with pytest.raises(EOFError):
        receive(theirs)


def test_a_connection_that_ends_within_a_message_is_broken(ends: tuple[Connection, Connection]) -> None:
    ours, theirs = ends
    os.write(ours.fileno(), struct.pack("!i", 100) + b"too little")
    ours.close()
    with pytest.raises(OSError, match="end of file"):
        receive(theirs)


def test_a_message_that_does_not_go_on_is_no_message() -> None:
    one, other = socket.socketpair()
    other.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, 10_000))
    with Connection(one.detach()) as ours, Connection(other.detach()) as theirs:
        os.write(ours.fileno(), struct.pack("!i", 100) + b"too little")
        with pytest.raises(OSError, match="unavailable"):
            receive(theirs)


@given(noise=st.text(st.characters(codec="ascii", min_codepoint=32), min_size=4, max_size=100))
def test_text_is_no_message(noise: str) -> None:
    ours, theirs = Pipe()
    with ours, theirs:
        os.write(ours.fileno(), noise.encode())
        with pytest.raises(OSError, match="bad message length"):
            receive(theirs)


@given(noise=st.binary(max_size=TOKEN_BYTES - 1))
def test_a_message_without_a_token_is_refused(noise: bytes) -> None:
    ours, theirs = Pipe()
    with ours, theirs:
        ours.send_bytes(noise)
        with pytest.raises(ValueError, match="a message of"):
            receive(theirs)


def test_what_is_no_answer_is_refused() -> None:
    for payload in (b"", b"1234", b"\1\0no record", b"\1\1", b"\1\1no JSON", b"\1\1[]", b"\1\1{}", b"\1\0017"):
        with pytest.raises(ValueError, match=r"."):
            read_answer(payload)


def test_a_setting_that_reads_otherwise_in_the_worker_is_refused() -> None:
    def asked(sentence: str) -> WorkerRequest:
        return WorkerRequest(Episode("driver", "1", sentence, 0), fake_route("1"), "code of the agent")

    assert str(asked("200 ms latency").read(Registry()).setting) == "200 ms latency"
    for sentence in ("200.0 ms latency", "a failure of somebody's 0.5"):
        with pytest.raises(UsageError, match="cannot be sent to the process that drives the episode"):
            asked(sentence).read(Registry())


def test_a_usage_error_keeps_its_class_and_its_text() -> None:
    result, is_spent = read_answer(answer_bytes(UnknownNameError("no such"), is_spent=True))
    assert is_spent
    assert (type(result), str(result)) == (UnknownNameError, "no such")
    assert type(refusal(b'["OSError", ""]')) is UsageError
