"""A headless Chromium that is told what to do, by its DevTools protocol on a WebSocket (RFC 6455)."""
import base64
import json
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import tempfile
import time
import urllib.request

FLAGS = ["--headless=new", "--no-sandbox", "--hide-scrollbars", "--use-gl=angle", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--remote-debugging-port=0", "about:blank"]


def wait_for(condition, seconds, what):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if value := condition():
            return value
        time.sleep(0.05)
    raise TimeoutError(what)


class Page:
    """A page at an address; ends its browser with the block."""

    def __init__(self, address, width=1000, height=700):
        self.profile = tempfile.mkdtemp(prefix="graupel_chromium_")
        self.browser = subprocess.Popen(["chromium", f"--user-data-dir={self.profile}", f"--window-size={width},{height}", *FLAGS],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        told = pathlib.Path(self.profile, "DevToolsActivePort")  # the port, and a path
        port = int(wait_for(lambda: told.exists() and "/" in told.read_text() and told.read_text().split()[0], 60,
                            "chromium does not start"))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            target = next(one for one in json.load(answer) if one["type"] == "page")
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=60)
        key = base64.b64encode(os.urandom(16)).decode()
        path = target["webSocketDebuggerUrl"].split(str(port), 1)[1]
        self.socket.sendall((f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                             f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n").encode())
        self.received, self.number, self.errors = b"", 0, []
        while b"\r\n\r\n" not in self.received:
            self.received += self.socket.recv(4096)
        self.received = self.received.split(b"\r\n\r\n", 1)[1]
        self.command("Runtime.enable")
        self.command("Page.enable")
        self.command("Page.navigate", url=address)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.browser.terminate()
        self.browser.wait(20)
        self.socket.close()
        shutil.rmtree(self.profile, ignore_errors=True)

    def _read(self, count):
        while len(self.received) < count:
            piece = self.socket.recv(1 << 16)
            if not piece:
                raise EOFError("chromium has ended")
            self.received += piece
        piece, self.received = self.received[:count], self.received[count:]
        return piece

    def _message(self):
        size = self._read(2)[1] & 127
        if size >= 126:
            size, = struct.unpack(">H" if size == 126 else ">Q", self._read(2 if size == 126 else 8))
        return json.loads(self._read(size))

    def command(self, method, **parameters):
        """The result; exceptions of the page are kept in `errors`."""
        self.number += 1
        text = json.dumps({"id": self.number, "method": method, "params": parameters}).encode()
        size = bytes([128 | len(text)]) if len(text) < 126 else bytes([128 | 126]) + struct.pack(">H", len(text))
        self.socket.sendall(b"\x81" + size + b"\0\0\0\0" + text)  # masked by zeros
        while True:
            message = self._message()
            if message.get("method") == "Runtime.exceptionThrown":
                self.errors.append(json.dumps(message["params"])[:500])
            if message.get("id") == self.number:
                return message.get("result", {})

    def value(self, expression):
        return self.command("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def text(self, name):
        """What the element `name` shows."""
        return self.value(f"(document.getElementById('{name}') || {{}}).innerText || ''")

    def wait(self, expression, what, seconds=60):
        return wait_for(lambda: self.value(expression), seconds, f"{what}: {self.errors}")

    def press(self, key, shift=False):
        for kind in ("keyDown", "keyUp"):
            self.command("Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 if shift else 0)

    def mouse(self, kind, x, y, **more):
        self.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start, end, button="left"):
        buttons = {"left": 1, "right": 2}[button]
        self.mouse("mousePressed", *start, button=button, buttons=buttons, clickCount=1)
        self.mouse("mouseMoved", *end, button=button, buttons=buttons)
        self.mouse("mouseReleased", *end, button=button, clickCount=1)

    def picture(self):
        return self.command("Page.captureScreenshot")["data"]
