"""Headless Chromium by its own debugging protocol over a pair of pipes: no package needed.

Source: Chrome DevTools Protocol, --remote-debugging-pipe: JSON texts, each ended by a zero byte.
"""

import base64
import json
import os
import pathlib
import select
import shutil
import subprocess
import tempfile
import time

KEYS = {"Tab": 9, "Enter": 13, "Home": 36, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = ("--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
         "--disable-component-update --disable-sync --disable-dev-shm-usage --hide-scrollbars "
         "--remote-debugging-pipe").split()

# The accessibility checks, if they are installed: npm install --global axe-core, or elsewhere with NODE_PATH.
AXE = next((file for place in (*os.environ.get("NODE_PATH", "").split(":"), "/usr/local/lib/node_modules", "/usr/lib/node_modules")
            if (file := pathlib.Path(place, "axe-core/axe.min.js")).exists()), None)

# tabStops(): every element that Tab must reach.
TAB_STOPS = """(() => { window.tabbed = new Set(); window.tabStops = () => Array.from(document.querySelectorAll('a[href], button, input, select, summary, [tabindex]'))
  .filter((e) => e.tabIndex >= 0 && !e.disabled && e.checkVisibility({ visibilityProperty: true })); })()"""
# Where a press of Tab led to: whether it was there before, and whether a reader sees it.
TABBED = """(() => { const e = document.activeElement; const again = e === document.body || tabbed.has(e); tabbed.add(e);
  const box = e.getBoundingClientRect(); const style = getComputedStyle(e);
  const x = Math.min(innerWidth - 1, Math.max(0, (box.left + box.right) / 2)), y = Math.min(innerHeight - 1, Math.max(0, (box.top + box.bottom) / 2));
  const top = document.elementFromPoint(x, y);
  return { again, ring: style.outlineStyle !== 'none' && parseFloat(style.outlineWidth) >= 1, seen: Boolean(top) && (e.contains(top) || top.contains(e)),
    html: e.outerHTML.slice(0, 120) }; })()"""


failures = []


def expect(condition, message):
    if not condition:
        failures.append(message)


def verdict():
    """Tells what was not as expected; returns the exit code."""
    for failure in failures[:30]:
        print("FAILED:", failure)
    if len(failures) > 30:
        print(f"and {len(failures) - 30} more")
    return 1 if failures else 0


def find_browser():
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def skipped(what):
    """The exit code where a check lacks what it needs."""
    print(what)
    return 1 if os.environ.get("STAGEID_REQUIRE_BROWSER") else 77


class Browser:
    """One page. `problems` gathers console messages of weight, uncaught errors and log entries."""

    def __init__(self, program):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)  # its children end a moment later
        ours, theirs = os.pipe(), os.pipe()

        def place_pipes():  # the browser reads descriptor 3 and writes 4
            end_in, end_out = os.dup(ours[0]), os.dup(theirs[1])
            os.dup2(end_in, 3)
            os.dup2(end_out, 4)

        self.process = subprocess.Popen([program, *FLAGS, f"--user-data-dir={self.profile.name}", "about:blank"],
                                        preexec_fn=place_pipes, close_fds=False, stderr=subprocess.DEVNULL)
        os.close(ours[0])
        os.close(theirs[1])
        self.to, self.back = ours[1], theirs[0]
        self.buffer, self.number, self.problems = b"", 0, []
        self.session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.call(domain + ".enable")

    def _read(self, timeout):
        end = time.monotonic() + timeout
        while b"\0" not in self.buffer:
            if not select.select([self.back], [], [], max(0, end - time.monotonic()))[0]:
                return None
            piece = os.read(self.back, 1 << 16)
            if not piece:
                raise RuntimeError("the browser is gone")
            self.buffer += piece
        text, self.buffer = self.buffer.split(b"\0", 1)
        message = json.loads(text)
        self._note(message)
        return message

    def _note(self, message):
        method, more = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.problems.append("uncaught: " + json.dumps(more["exceptionDetails"])[:400])
        if method == "Runtime.consoleAPICalled":
            self.problems.append("console: " + json.dumps(more["args"])[:400])
        if method == "Log.entryAdded" and more["entry"]["level"] in ("error", "warning"):
            self.problems.append("log: " + more["entry"]["text"] + " " + more["entry"].get("url", ""))

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read(60)
            if answer is None:
                raise RuntimeError(f"{method}: the browser does not answer")
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def evaluate(self, script):
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise RuntimeError(f"{script}: {details.get('exception', {}).get('description', details)}")
        return answer["result"].get("value")

    def wait_for(self, script, seconds=60):
        """True once the expression is; False if it never was."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            # The page before this one has nothing to show: not an error.
            if self.evaluate(f"(() => {{ try {{ return {script}; }} catch (e) {{ return false; }} }})()"):
                return True
            time.sleep(0.1)
        return False

    def check_widths(self, folder, what, height, accessible=True):
        """No page is wider than its window; a screenshot of each in `folder`. Ends at 1280 pixels, light.

        accessible: also check_accessibility() of each, which takes long on a page of thousands of elements."""
        for width, dark in ((1280, False), (1280, True), (390, False), (390, True)):
            self.resize(width, height, dark)
            self.evaluate("new Promise((f) => setTimeout(f, 500))")
            overflow = self.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            expect(overflow <= 0, f"{what}: at {width} pixels the page is {overflow} pixels too wide")
            if accessible:
                self.check_accessibility(f"{what}, {width} pixels, {'dark' if dark else 'light'}")
            self.screenshot(folder / f"{what}_{width}{'_dark' if dark else ''}.png")
        self.resize(1280, height)

    def check_accessibility(self, what):
        """No violation of the rules of axe, if it is installed; with everything unfolded."""
        if AXE is None:
            return
        self.evaluate(AXE.read_text() + "; null")
        found = self.evaluate("""(async () => { const folded = Array.from(document.querySelectorAll('details:not([open])'));
            for (const one of folded) one.open = true;
            await new Promise((done) => setTimeout(done, 100));
            const { violations } = await axe.run();
            for (const one of folded) one.open = false;
            return violations.map(({ id, nodes }) => id + ': ' + nodes.slice(0, 5).map(({ target }) => target.join(' ')).join(', ')); })()""")
        expect(found == [], f"{what}: axe: {found}")

    def check_tab(self, what):
        """From the top of a fresh page, Tab leads to every control, and its focus is visible."""
        self.evaluate(TAB_STOPS)
        for _ in range(self.evaluate("tabStops().length") + 10):
            self.press("Tab")
            stop = self.evaluate(TABBED)
            if stop["again"]:
                break
            expect(stop["ring"] and stop["seen"], f"{what}: the focus is not visible: {stop}")
        missed = self.evaluate("tabStops().filter((e) => !tabbed.has(e)).map((e) => e.outerHTML.slice(0, 120))")
        expect(missed == [], f"{what}: Tab does not reach {missed}")

    def resize(self, width, height, dark=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.call("Emulation.setEmulatedMedia",
                  features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def press(self, key):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=KEYS[key],
                      **({"text": "\r"} if key == "Enter" and kind == "keyDown" else {}))

    def screenshot(self, file):
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)["data"]
        file.write_bytes(base64.b64decode(data))

    def close(self):
        self.process.terminate()
        self.process.wait()
        os.close(self.to)
        os.close(self.back)
        self.profile.cleanup()
