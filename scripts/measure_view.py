#!/usr/bin/env python3
"""Measures how many frames a second a live view sends to a page that draws at once: docs/results/gpu_view.csv.

    scripts/measure_view.py build/cuda/bin/phyxel --device cuda --phyxels 1000000     a cube of a million phyxels
    scripts/measure_view.py build/cpu/bin/phyxel examples/dino examples/horn_bug      scenes of their own

The page is this script: it joins the view by a WebSocket, says of each frame at once that it has seen it, and counts for some
seconds. Frames have no field, as when a page opens.
"""
import argparse
import base64
import csv
import datetime
import json
import os
import pathlib
import re
import socket
import struct
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
COLUMNS = ["scene", "phyxels", "device", "frames_per_s", "speed", "kb_per_frame"]
CUBE = """title = "A cube of {phyxels} phyxels, let fall"
gravity = [0, 0, -9.81]
[time]
end = 1e6
[solver]
precision = "float"
[[body]]
name = "cube"
shape = "block"
size = [1, 1, 1]
phyxels = {phyxels}
[body.material]
young = 1e6
poisson = 0.3
density = 1000
"""


class Page:
    """The end of a WebSocket (RFC 6455) at which the page is."""

    def __init__(self, address):
        host, port, path = re.match(r"http://([^:/]+):(\d+)(/\S*)", address).groups()
        token = path[path.index("?"):]
        self.stream = socket.create_connection((host, int(port)), timeout=60)
        key = base64.b64encode(os.urandom(16)).decode()
        self.stream.sendall((f"GET /live{token} HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: http://{host}:{port}\r\nUpgrade: websocket\r\n"
                             f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n").encode())
        self.file = self.stream.makefile("rb")
        status = self.file.readline()
        if b" 101 " not in status:
            raise SystemExit(f"the view refuses to be joined: {status.decode().strip()}")
        while self.file.readline().strip():
            pass

    def send(self, what):
        text = json.dumps(what, separators=(",", ":")).encode()
        mask = os.urandom(4)
        self.stream.sendall(bytes([0x81, 0x80 | len(text)]) + mask + bytes(c ^ mask[k % 4] for k, c in enumerate(text)))

    def hear(self):
        """The next message: bytes of a frame, or a dictionary."""
        parts = []
        while True:
            first, size = self.file.read(2)
            size &= 0x7F
            if size > 125:
                size = int.from_bytes(self.file.read(2 if size == 126 else 8), "big")
            parts.append(self.file.read(size))
            if first & 0x0F:
                kind = first & 0x0F
            if first & 0x80:
                break
        whole = b"".join(parts)
        return json.loads(whole) if kind == 1 else whole


def measured(program, scene, device, seconds):
    """Frames a second, simulated seconds a second, and kB of a frame."""
    command = [program, "view", scene, *(["--device", device] if device else [])]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as view:
        try:
            said = []
            for line in view.stdout:
                said.append(line)
                if found := re.search(r"http://\S+token=\S+", line):
                    break
            else:
                raise SystemExit("".join(said))
            page = Page(found[0])
            times, sizes = [], []
            first = None
            while first is None or time.monotonic() < first + seconds:
                message = page.hear()
                if isinstance(message, dict):
                    continue
                page.send({"do": "seen"})
                if first is None:  # the first frame waits for the set-up
                    first = time.monotonic()
                times.append(struct.unpack_from("<d", message, 16)[0])
                sizes.append(len(message))
            lasted = time.monotonic() - first
            return (len(times) - 1) / lasted, (times[-1] - times[0]) / lasted, sum(sizes) / len(sizes) / 1e3
        finally:
            view.terminate()
            view.wait()


def row_of(program, scene, device, seconds):
    """A row of the table for a scene file."""
    command = [program, "run", scene, "--dry-run", "--json", *(["--device", device] if device else [])]
    facts = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    rate, speed, kb = measured(program, scene, device, seconds)
    return [facts["title"].replace(",", ";"), facts["phyxels"], facts["device"].replace(",", ";"), f"{rate:.3g}", f"{speed:.3g}", f"{kb:.4g}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("scenes", nargs="*", type=pathlib.Path, help="scene files, or folders with a scene.toml")
    parser.add_argument("--phyxels", type=int, nargs="*", default=[], help="cubes of so many phyxels, too")
    parser.add_argument("--device", help="as of phyxel view")
    parser.add_argument("--seconds", type=float, default=8, help="of each measurement")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/results/gpu_view.csv", help="table to write")
    options = parser.parse_args()
    program = options.program.resolve()
    scenes = [scene / "scene.toml" if scene.is_dir() else scene for scene in options.scenes]
    with tempfile.TemporaryDirectory() as folder:
        for phyxels in options.phyxels:
            scenes.append(pathlib.Path(folder) / f"cube_{phyxels}.toml")
            scenes[-1].write_text(CUBE.format(phyxels=phyxels))
        rows = [row_of(program, scene, options.device, options.seconds) for scene in scenes]
    version = subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout.strip()
    with options.out.open("w") as file:
        file.write(f"# program: {version}\n# date: {datetime.date.today().isoformat()}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)
    print(options.out.read_text(), end="")


if __name__ == "__main__":
    main()
