"""A studio that is asked by HTTP, and its page in a headless Chromium. Standard library only."""

import base64
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request


class Studio:
    """A studio of its own, to be asked by HTTP."""

    def __init__(self, fleetyard, *files, cwd):
        self.process = subprocess.Popen([fleetyard.path, "studio", "--no-open", *map(str, files)], cwd=cwd,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().strip()
        if not self.address:
            sys.exit("the studio did not start")
        parts = urllib.parse.urlsplit(self.address)
        self.host, self.token = parts.netloc, urllib.parse.parse_qs(parts.fragment)["token"][0]

    def ask(self, path, value=None):
        data = None if value is None else json.dumps(value).encode()
        request = urllib.request.Request(f"http://{self.host}/api{path}", data)
        request.add_header("Authorization", f"Bearer {self.token}")
        try:
            with urllib.request.urlopen(request) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            sys.exit(f"{path}: {error.code} {error.read().decode()}")

    def ended(self, job):
        while (job := self.ask(f"/jobs/{job['id']}"))["state"] in ("queued", "running", "stopping"):
            time.sleep(0.1)
        return job

    def deaf(self, job):
        """A client that watches a fleet and never reads."""
        host, port = self.host.split(":")
        client = socket.create_connection((host, int(port)))
        key = base64.b64encode(os.urandom(16)).decode()
        client.sendall(f"GET /api/feed HTTP/1.1\r\nHost: {self.host}\r\nAuthorization: Bearer {self.token}\r\nUpgrade: websocket\r\n"
                       f"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n".encode())
        client.recv(4096)
        said = json.dumps({"type": "watch", "job": job, "rate": 60}).encode()
        mask = os.urandom(4)
        client.sendall(bytes([0x81, 0x80 | len(said)]) + mask + bytes(byte ^ mask[at % 4] for at, byte in enumerate(said)))
        return client

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait()


class Page:
    """A page in a headless Chromium, driven over the two pipes that the DevTools protocol has."""

    def __init__(self, folder):
        browser = next(filter(None, map(shutil.which, ["chromium", "chromium-browser", "google-chrome"])), None)
        if browser is None:
            sys.exit("there is no Chromium on this machine")
        heard, say = os.pipe()
        hear, said = os.pipe()

        def pipes():
            # Whatever numbers the pipes have, the browser finds them at 3 and 4.
            for number, pipe in enumerate([os.dup(heard), os.dup(said)], 3):
                os.dup2(pipe, number)

        flags = ["--headless", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run", "--disable-gpu", "--remote-debugging-pipe",
                 "--window-size=1280,800", f"--user-data-dir={folder / 'profile'}", "about:blank"]
        self.process = subprocess.Popen([browser, *flags], preexec_fn=pipes, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(heard)
        os.close(said)
        self.out, self.hear, self.rest, self.last, self.session = say, hear, b"", 0, None
        self.tab()

    def tab(self):
        """Opens a tab, which calls go to from then on. Returns its session."""
        self.session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        return self.session

    def call(self, method, **parameters):
        self.last += 1
        message = {"id": self.last, "method": method, "params": parameters, **({"sessionId": self.session} if self.session else {})}
        os.write(self.out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self.rest:
                read = os.read(self.hear, 1 << 16)
                if not read:
                    sys.exit("the browser went away")
                self.rest += read
            text, self.rest = self.rest.split(b"\0", 1)
            answer = json.loads(text)
            if answer.get("id") == self.last:
                if "error" in answer:
                    sys.exit(f"{method}: {answer['error']}")
                return answer["result"]

    def eval(self, script):
        done = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in done:
            sys.exit(f"the page: {done['exceptionDetails']}")
        return done["result"].get("value")

    def go(self, address):
        self.call("Page.navigate", url=address)

    def until(self, script, patience_s=120):
        end = time.monotonic() + patience_s
        while not self.eval(f"(() => {{ try {{ return Boolean({script}); }} catch {{ return false; }} }})()"):
            if time.monotonic() > end:
                sys.exit(f"the page never came to: {script}")
            time.sleep(0.02)

    def mouse(self, kind, x, y, buttons=1):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=buttons, clickCount=1)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
