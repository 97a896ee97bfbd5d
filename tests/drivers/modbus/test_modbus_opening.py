"""What the Modbus driver says where a device cannot be opened."""

import pytest
from modbus_bench import TcpPeer, make, registers_of, reply_pdu, tcp_bench, tcp_frame

from motorctl.hal import RunError

pytestmark = pytest.mark.wall_clock(lanes=3)


def refusal(answer, **changes):
    """What `open` says where the device answers its first request with this."""
    bench = tcp_bench(connect_timeout_s=0.2, **changes)

    def serve():
        answer(bench.peer, bench.peer.request())

    try:
        with pytest.raises(RunError) as caught:
            bench.open(serve)
        return str(caught.value), bench.peer.port
    finally:
        bench.close()


def test_a_device_without_function_code_23_is_named_as_such():
    said, port = refusal(lambda peer, r: peer.send(peer.frame(r, bytes([0x97, 1]))))
    assert said.startswith(f"unit: unit 1 at 127.0.0.1:{port} does not support function code 23")


def test_an_illegal_address_is_told_with_the_range_of_registers():
    said, _ = refusal(lambda peer, r: peer.send(peer.frame(r, bytes([0x97, 2]))))
    assert "exception 2 (illegal data address)" in said
    assert "0x0000 to 0x0004 to read" in said
    assert "0x0100 to 0x0103 to write" in said


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda peer, r: peer.send(peer.frame(r, bytes([0x97, 11]))), "no answer behind the gate"),
        (lambda peer, r: peer.send(peer.frame(r, bytes([0x97, 99]))), "exception 99 (unknown)"),
        (lambda peer, r: None, "no valid answer within 0.2 s"),
        (lambda peer, r: peer.send(b"garbage in, and a lot of it, without any end"), "no valid"),
        (lambda peer, r: peer.drop(), "closed the connection"),
        (lambda peer, r: peer.send(peer.frame(r, reply_pdu([1, 2]))), "with 2 by function code 23"),
        (
            lambda peer, r: peer.send(peer.frame(r, reply_pdu(registers_of((0, 0), 77)))),
            "sequence.input",
        ),
        (
            lambda peer, r: peer.send(
                peer.frame(r, reply_pdu(registers_of((0, 0), r.sequence)), unit=9)
            ),
            "no valid answer",
        ),
    ],
    ids=[
        "gateway",
        "unknown exception",
        "silence",
        "garbage",
        "hang-up",
        "too few",
        "no echo",
        "unit",
    ],
)
def test_open_says_in_one_line_what_is_wrong_with_the_answer(answer, words):
    said, port = refusal(answer)
    assert words in said
    assert f"127.0.0.1:{port}" in said
    assert "\n" not in said


def test_a_refused_connection_names_key_host_and_reason(caplog, capfd):
    peer = TcpPeer()
    peer.close()
    with pytest.raises(RunError) as caught:
        make(tcp={"host": "127.0.0.1", "port": peer.port}).open()
    said = str(caught.value)
    assert said.startswith(f"tcp.host: cannot connect to 127.0.0.1:{peer.port}")
    assert "Connection refused" in said
    assert not caplog.records, "what the library logs goes into the message and nowhere else"
    assert capfd.readouterr() == ("", "")


def test_an_unknown_host_is_refused_within_the_timeout():
    with pytest.raises(RunError, match=r"tcp.host: cannot connect to no.such.host.invalid:502"):
        make(tcp={"host": "no.such.host.invalid"}).open()


def test_a_failed_open_leaves_no_connection_behind():
    bench = tcp_bench(connect_timeout_s=0.2)
    with pytest.raises(RunError):
        bench.open(
            lambda: bench.peer.send(tcp_frame(bench.peer.request().transaction, b"\x97\x01"))
        )
    assert bench.peer.connection.recv(1) == b""
    bench.open()
    assert bench.read() == ([0, 0], [0, 0])
    bench.close()
