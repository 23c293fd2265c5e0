"""A page of a live view without a browser: a client of its stream of messages (RFC 6455)."""
import base64
import json
import os
import socket
import struct
import time
import urllib.parse


class Page:
    """A connected page. It says at once that it has drawn a frame."""

    def __init__(self, address):
        parts = urllib.parse.urlsplit(address)
        self._socket = socket.create_connection((parts.hostname, parts.port), timeout=60)
        self._socket.sendall(f"GET /live?{parts.query} HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\n"
                             "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
                             f"{base64.b64encode(os.urandom(16)).decode()}\r\n\r\n".encode())
        self._read = self._socket.makefile("rb")
        assert b" 101 " in self._read.readline()
        while self._read.readline().strip():
            pass
        self.time = None  # of the last frame [s]
        self.messages = []

    def send(self, **request):
        data = json.dumps(request, separators=(",", ":")).encode()
        head = bytes([0x81, 0x80 | len(data)]) if len(data) < 126 else bytes([0x81, 0xfe]) + struct.pack(">H", len(data))
        self._socket.sendall(head + bytes(4) + data)  # a mask of zeros

    def hear(self):
        """Receives a message."""
        kind, length = self._read.read(2)
        if length == 126:
            length, = struct.unpack(">H", self._read.read(2))
        elif length == 127:
            length, = struct.unpack(">Q", self._read.read(8))
        data = self._read.read(length)
        if kind & 15 == 2:
            self.time, = struct.unpack_from("<d", data, 16)
            self.send(do="seen")
        elif kind & 15 == 1:
            self.messages.append(json.loads(data))

    def until(self, wanted, seconds=60):
        """Hears messages until something is so."""
        end = time.monotonic() + seconds
        while not wanted():
            assert time.monotonic() < end, self.messages[-3:]
            self.hear()

    def close(self):
        self._socket.close()
