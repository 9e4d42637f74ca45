"""Checks the webhooks of a darn binary against `standardwebhooks`; started by scripts/webhooks."""

import base64
import datetime
import http.server
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse
import urllib.request

from standardwebhooks.webhooks import Webhook, WebhookVerificationError

SCAN = "examples/scarf_hole.glb"
TIMEOUT = 0.5
failed = False


def check(what, holds, found=""):
    global failed
    failed = failed or not holds
    print(f"{'ok    ' if holds else 'FAILED'} {what}{'' if holds else f': {found}'}", flush=True)


class Sink:
    """A receiver that answers with statuses in turn, the last one again and again; "hang": not at all."""

    def __init__(self, answers, port=0):
        self.received = []
        sink = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(self):
                body = self.rfile.read(int(self.headers["content-length"]))
                sink.received.append((self.path, dict(self.headers), body))
                answer = answers.pop(0) if len(answers) > 1 else answers[0]
                if answer == "hang":
                    time.sleep(4 * TIMEOUT)
                    self.close_connection = True
                    return
                self.send_response(answer)
                if answer == 302:
                    self.send_header("location", "/elsewhere")
                self.send_header("content-length", "0")
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def url(self):
        return f"http://127.0.0.1:{self.port}/hook?token=t0k3n"


class Darn:
    """A running darn."""

    def __init__(self, binary, folder):
        settings = ["--data", f"{folder}/data", "--webhook-secret", f"{folder}/secret", "--webhook-http"]
        settings += ["--webhook-allow", "127.0.0.1/32", "--webhook-timeout", f"{int(1000 * TIMEOUT)}ms"]
        self.log = open(f"{folder}/log", "a+")
        self.process = subprocess.Popen([binary, "serve", "--listen", "127.0.0.1:0", *settings], stderr=self.log)
        self.base = None
        begin = os.path.getsize(f"{folder}/log")
        until = time.time() + 30
        while self.base is None and time.time() < until:
            with open(f"{folder}/log") as log:
                log.seek(begin)
                for line in log:
                    if "listening" in line and "address=" in line:
                        self.base = "http://" + line.split("address=")[1].split()[0]
            time.sleep(0.02)

    def ask(self, path, body=None):
        request = urllib.request.Request(self.base + path, data=body, headers={"content-type": "model/gltf-binary"})
        with urllib.request.urlopen(request) as answer:
            return json.load(answer)

    def submit(self, url):
        with open(SCAN, "rb") as scan:
            query = urllib.parse.urlencode({"webhook": url})
            return self.ask(f"/jobs?{query}", scan.read())["id"]

    def until(self, job, holds):
        end = time.time() + 60
        while True:
            found = self.ask(f"/jobs/{job}")
            if holds(found) or time.time() > end:
                return found
            time.sleep(0.05)


def main(binary):
    with tempfile.TemporaryDirectory() as folder:
        secret = "whsec_" + base64.b64encode(os.urandom(32)).decode()
        with open(f"{folder}/secret", "w") as file:
            file.write(secret)
        receiver = Webhook(secret)
        stranger = Webhook("whsec_" + base64.b64encode(os.urandom(32)).decode())
        darn = Darn(binary, folder)

        sinks = {name: Sink(answers) for name, answers in {
            "204": [204],
            "500, then 200": [500, 200],
            "302": [302],
            "410": [410],
            "silence": ["hang"],
        }.items()}
        jobs = {name: darn.submit(sink.url()) for name, sink in sinks.items()}
        told = {}
        for name, job in jobs.items():
            waits_for = "DELIVERED" if name in ("204", "500, then 200") else None
            found = darn.until(job, lambda job: "lastTryAt" in job["webhook"] and waits_for in (None, job["webhook"]["state"]))
            told[name] = found["webhook"]
        for name, expected in {
            "204": {"state": "DELIVERED", "tries": 1, "lastStatus": 204},
            "500, then 200": {"state": "DELIVERED", "tries": 2, "lastStatus": 200},
            "302": {"state": "PENDING", "lastStatus": 302},
            "410": {"state": "DISABLED", "lastStatus": 410},
            "silence": {"state": "PENDING", "lastStatus": None},
        }.items():
            found = {key: told[name].get(key) for key in expected}
            check(f"a receiver that answers with {name}: {expected}", found == expected, told[name])
        check("redirects are not followed", {it[0] for it in sinks["302"].received} == {"/hook?token=t0k3n"})

        messages = [it for sink in sinks.values() for it in sink.received]
        verified, strange = 0, 0
        for _, headers, body in messages:
            headers = {name.lower(): value for name, value in headers.items()}
            event = receiver.verify(body, headers)
            verified += event["type"] == "job.done"
            for other, text in ((stranger, body), (receiver, body.replace(b"job.done", b"job.gone"))):
                try:
                    other.verify(text, headers)
                except WebhookVerificationError:
                    strange += 1
        check(f"standardwebhooks verifies all {len(messages)} messages", verified == len(messages) >= 6, verified)
        check("and none with another secret or another body", strange == 2 * len(messages), strange)
        ids = {headers["webhook-id"] for _, headers, _ in sinks["500, then 200"].received}
        check("a second try has the id of the first", len(ids) == 1, ids)

        closed = Sink([204])
        closed.server.shutdown()
        closed.server.server_close()
        job = darn.submit(closed.url())
        darn.until(job, lambda job: job["state"] == "DONE")
        darn.process.send_signal(signal.SIGKILL)
        darn.process.wait()
        sink = Sink([204], closed.port)
        darn = Darn(binary, folder)
        found = darn.until(job, lambda job: job["webhook"]["state"] == "DELIVERED")
        check("kill -9 between a job's end and its webhook: delivered", found["webhook"]["state"] == "DELIVERED", found)
        check("to its receiver", len(sink.received) == 1, len(sink.received))
        darn.process.terminate()
        darn.process.wait()
        with open(f"{folder}/log") as log:
            text = log.read()
        check("the log has the tries", "webhook tried" in text)
        check("and neither the secret nor what stands in URLs", not any(it in text for it in (secret, secret[6:], "t0k3n", "/hook")))

    vector = Webhook("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")
    time_of = datetime.datetime.fromtimestamp(1614265330, datetime.timezone.utc)
    signed = vector.sign("msg_p5jXN8AQM9LWM0D4loKWxJek", time_of, '{"test": 2432232314}')
    check("the vector of crates/serve/src/webhook/secret.rs", signed == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=", signed)
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
