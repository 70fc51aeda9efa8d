#!/usr/bin/env python3
"""Opens report pages, with selftest.js added to their script, in headless Chromium, and compares what the page finds in
itself with what was written into it.

    check_report.py --sample REPORT_SAMPLE --work DIRECTORY [--kind full|full_compared|small|compared|bare|hostile]

Exit code 77 (skipped) when there is no Chromium and STAGEID_REQUIRE_BROWSER is not set.
"""

import base64
import json
import math
import pathlib
import subprocess
import sys

from page_checks import expect, open_page, run

COLOURS = """(async () => { const picture = new Image(); picture.src = 'data:image/png;base64,%s'; await picture.decode();
  const context = new OffscreenCanvas(picture.width, picture.height).getContext('2d'); context.drawImage(picture, 0, 0);
  return new Set(new Uint32Array(context.getImageData(0, 0, picture.width, picture.height).data.buffer)).size; })()"""
SELF_TEST = pathlib.Path(__file__).with_name("selftest.js")
END_OF_SCRIPT = b"})();\n</script>\n</body>"
LARGEST_PAGE = {"full": 4_000_000, "full_compared": 4_800_000}  # bytes, of 4 x 13 x 4000
# Of these it takes half a minute to read all numbers back, and their layout is that of the others.
WIDTHS = {"full": (1280,), "full_compared": (390,)}

def near(got, want, tolerance, message):
    expect(isinstance(got, (int, float)) and math.isclose(got, want, rel_tol=tolerance, abs_tol=0.0),
           f"{message}: {got!r} instead of {want!r} (tolerance {tolerance:g})")


def with_self_test(page):
    """A copy of the page whose script ends with selftest.js."""
    before, end, after = page.read_bytes().rpartition(END_OF_SCRIPT)
    if not end:
        raise RuntimeError(f"{page}: contains no script that ends with {END_OF_SCRIPT}")
    copy = page.with_name("selftest.html")
    copy.write_bytes(before + SELF_TEST.read_bytes() + end + after)
    return copy


def findings(page, width):
    """What the page says of itself when it is `width` pixels wide."""
    browser = open_page(page, width, ready="window.selfTestEnded === true")
    found = json.loads(browser.evaluate("window.selfTest"))
    expect(browser.problems == [], f"console: {browser.problems}")
    browser.close()
    return found


def check_arrays(found, expected):
    # float64 and float32 are exact. Sums of up to 4e5 products round to eps sqrt(4e5) of the largest.
    exact = {"frequency": 1e-15, "response": 1e-15, "cmif": 1e-15, "interpolation_misfit": 1e-15}
    # Five bytes a complex number: 2^-15 of its larger part. One byte: half of 254 steps a row; the
    # rows of the sample span at most 8 decades: a factor 10^(4/254).
    coarse = {"residual": 2.0**-14, "other_response": 2.0**-14, "other_model": 2.0**-14, "deviation": 10 ** (4 / 254) - 1}
    for name, want in expected["arrays"].items():
        got = found["arrays"].get(name)
        if got is None:
            expect(False, f"the page has no {name}")
            continue
        tolerance = {**exact, **coarse}[name]
        check_summary(got, want, tolerance, name, tolerance if name in coarse else 1e-12)
        for key in ("low", "high"):
            near(got[key], want[key], tolerance, f"{name}: {key}")
        if name in exact:
            near(got["weighted"], want["weighted"], 1e-9, f"{name}: weighted sum")


def check_response(found, expected):
    """Panels, and what the large plot draws of every element."""
    expect(found["panels"] == expected["panels"], f"{found['panels']} panels instead of {expected['panels']}")
    expect(found["panels_with_ink"] == found["panels"], f"only {found['panels_with_ink']} panels are drawn")
    expect(found["panels_with_peak"] == found["panels"],
           f"only {found['panels_with_peak']} of {found['panels']} panels show their highest peak")
    expect(found["panel_sizes"]["width"] >= 55 and found["panel_sizes"]["height"] >= 50,
           f"panels of {found['panel_sizes']} pixels")
    check_arrays(found, expected)
    traces = ["measured"] + (["model", "residual"] if "model" in expected else [])
    for channel, entry in enumerate(found["entries"]):
        expect(set(traces) <= set(entry["traces"]), f"element {channel} shows {entry['traces']}")
        expect(entry["lines"] == expected["lines"], f"element {channel} has {entry['lines']} lines")
        for name in ("measured", "model"):
            if name not in expected:
                continue
            # Both are sums or differences of numbers kept to 2^-15 of the residual, float32 at worst.
            want = expected[name][channel]
            near(entry["extremes"][name]["high"], want["high"], 1e-4, f"element {channel}, {name}: high")
            near(entry["extremes"][name]["low"], want["low"], 1e-2, f"element {channel}, {name}: low")


def check_zoom(zoom):
    for plot, got in zoom["ranges"].items():
        for bound, want in zip(got, zoom["asked"]):
            near(bound, want, 1e-9, f"zoom of {plot}")
    expect(zoom["points"] == zoom["wanted"], f"{zoom['points']} points in the complex plane instead of {zoom['wanted']}")
    for plot, got in zoom["restored"].items():
        for bound, want in zip(got, zoom["whole"][plot]):
            near(bound, want, 1e-6, f"zoom of {plot} taken back")


def check_drag(drag):
    low, high = drag["whole"]
    middle = math.sqrt(low * high)
    for got, want in zip(drag["got"], (middle, high)):
        near(got, want, 1e-3, "drag across half a panel")
    width = math.log(high / middle)
    near(math.log(drag["nearer"][1] / drag["nearer"][0]), width / 2, 5e-3, "the key + shows half of it")


def check_summary(got, want, tolerance, what, of_the_sum=None):
    """Tolerances are relative to the largest number; that of the weighted sum may be another."""
    expect(got["count"] == want["count"], f"{what}: {got['count']} numbers instead of {want['count']}")
    scale = max(abs(want["low"]), abs(want["high"]))
    for key in ("low", "high", "first", "last"):
        expect(abs(got[key] - want[key]) <= tolerance * scale, f"{what}: {key}: {got[key]} instead of {want[key]}")
    expect(abs(got["weighted"] - want["weighted"]) <= (of_the_sum or tolerance) * scale * 1009 * want["count"],
           f"{what}: weighted sum {got['weighted']} instead of {want['weighted']}")


def check_nyquist(found, expected):
    """Tolerances as in check_arrays(); the model is the float32 response less the residual."""
    for got, want in zip(found, expected):
        name = f"element {got['channel']} in the complex plane"
        check_summary(got["measured"], want["measured"], 1e-15, f"{name}, measured")
        for key, tolerance in (("model", 2.0**-14), ("radius", 10 ** (4 / 254) - 1)):
            if key in want:
                check_summary(got[key], want[key], tolerance, f"{name}, {key}")


def mac(a, b):
    """|a^H b|^2 / (|a|^2 |b|^2) of shapes given as [re, im, ...]."""
    a, b = ([complex(*v[i:i + 2]) for i in range(0, len(v), 2)] for v in (a, b))
    inner = sum(x.conjugate() * y for x, y in zip(a, b))
    return abs(inner) ** 2 / (sum(abs(x) ** 2 for x in a) * sum(abs(y) ** 2 for y in b))


def check_shapes(found, expected):
    want = expected["shapes"]
    expect(len(found["modes"]) == len(want), f"{len(found['modes'])} shapes instead of {len(want)}")
    for i, (got, mode) in enumerate(zip(found["modes"], want)):
        for kind in ("outputs", "inputs"):  # five decimals
            error = max(abs(x - y) for x, y in zip(got[kind], mode[kind]))
            expect(error <= 0.6e-5 and len(got[kind]) == len(mode[kind]), f"shape {i}, {kind}: off by {error}")
    for kind, name in (("outputs", "output_mac"), ("inputs", "input_mac")):
        for i, row in enumerate(found[name]):
            for j, value in enumerate(row):
                expect(abs(value - mac(want[i][kind], want[j][kind])) <= 0.6e-4, f"{name} {i}, {j}: {value}")
    expect(found["places"] == expected["places"], f"{found['places']} channels with a place")
    expect(found["surface"] == (expected["places"] > 3), "surface where there are no places, or none where there are")
    expect(found["plane_error"] < 1e-9 and found["meet_error"] < 1e-9 and found["on_a_line"], f"surface: {found}")


def check_comparison(found, want, entries):
    expect(len(found["pairs"]) == len(want["pairs"]), f"{len(found['pairs'])} pairs of modes")
    for got, pair in zip(found["pairs"], want["pairs"]):
        expect((got["own"], got["other"]) == (pair["own"], pair["other"]), f"pair {got}")
        for key in ("frequency_difference", "frequency_deviation"):
            near(got[key], pair[key], 1e-9, f"pair {pair['own']}: {key}")
        for key in ("output_mac", "input_mac"):
            near(got[key], 1.0, 1e-9, f"pair {pair['own']}: {key}")
    expect(found["rows"] == len(want["pairs"]), f"{found['rows']} rows in the table of pairs")
    for channel, entry in enumerate(entries):
        for name, tolerance in (("other", 1e-4), ("otherModel", 1e-4), ("change", 1e-2)):
            near(entry["extremes"][name]["high"], want[name][channel]["high"], tolerance, f"element {channel}, {name}: high")
        for name in ("other", "otherModel"):
            near(entry["extremes"][name]["low"], want[name][channel]["low"], 1e-2, f"element {channel}, {name}: low")


def check_correlated(text, want, lines):
    """What the page says of a zippered experiment, beside the modes and in a section of its own; else nothing."""
    if want is None:
        expect("independent" not in text and "local model" not in text, f"of no zippered experiment: {text}")
        return
    for part in (f"{lines} lines constrain a smooth model as much as {want['independent']} independent ones",
                 "The standard deviations include this", f"{want['independent']} of {lines}",
                 f"largest {want['largest']:.3g} at {want['at_hz']:.4g}"):
        expect(part in text.replace("\u00a0", " "), f"not said: {part!r}, but {text!r}")


def check_diagrams(found, expected):
    poles = expected["stabilization"]
    expect(len(found["stabilization"]["poles"]) == len(poles), "poles of the stabilization diagram")
    for got, want in zip(found["stabilization"]["poles"], poles):
        expect(got[0] == want[0] and got[3] == want[3] and abs(got[1] - want[1]) < 1e-4 and abs(got[2] / want[2] - 1) < 1e-3,
               f"pole {got} instead of {want}")
    stable = sum(pole[3] == 2 for pole in poles)
    expect(found["stabilization"]["drawn"] == stable, f"{found['stabilization']['drawn']} stable poles drawn instead of {stable}")
    expect(found["loops"] == expected["loops"], f"{found['loops']} loops instead of {expected['loops']}")
    if expected["loops"]:
        expect(found["loop_margin"] == "11.60 \u00b1 0.20\u00a0dB at 62.13\u00a0Hz (extrapolated)", found["loop_margin"])
        expect(found["loop_discs"] > 10, f"only {found['loop_discs']} discs are drawn")
    expect(found["distorted"] == expected["distorted"], f"{found['distorted']} coloured bars instead of {expected['distorted']}")
    if expected["distorted"]:
        expect(found["distortion_text"].startswith(f"1 of {2 * expected['panels']} pairs and bands scatter by more than noise")
               and found["distortion_text"].endswith("in 1 of 3 bands the records are not settled"), found["distortion_text"])  # fmt: skip
    expect(found["findings"] == expected["findings"], f"{found['findings']} findings instead of {expected['findings']}")
    if found["findings"]:
        expect(found["first_finding"] == "fault", f"the first finding is {found['first_finding']}")


def check_saved(saved):
    for name, file in saved.items():
        expect(not file["broken"], f"the saved {name} is no sound SVG")
        expect(file["marks"] > 3 and file["ink"], f"the saved {name} is empty: {file}")
        expect(file["png"] == [round(file["width"]), round(file["height"])], f"the saved {name} has {file['png']} pixels")
    if "element" in saved:
        peak = saved["element"]["peak"]
        expect(abs(peak["found"] - peak["wanted"]) < 0.1, f"the saved element has its peak elsewhere: {peak}")


def check_use(use, expected, width):
    expect(use["clicked"] == use["last"], f"a click on the last panel shows {use['clicked']!r}")
    # To the right is the next actuator; on a narrow page, which is transposed, the next sensor.
    outputs, inputs = expected["shape"]
    step = min(1, outputs - 1) if width <= 700 else outputs * min(1, inputs - 1)
    expect(use["walked"] == step, f"the right arrow leads to panel {use['walked']} instead of {step}")
    expect(use["hidden"], "a trace that was switched off is still there")
    near(use["scaled"], 1.0, 1e-12, "times omega squared")


def check_page(found, expected, width):
    expect(found["errors"] == [], f"errors: {found['errors']}")
    expect(found["injected"] == 0, f"{found['injected']} elements came in with a text")
    expect(found["width"] == width, f"the window is {found['width']} pixels wide instead of {width}")
    expect(found["overflow"] <= 0, f"at {width} pixels the page is {found['overflow']} pixels too wide")
    for name, ink in found["plots"].items():
        expect(ink, f"the plot {name} is empty")
    check_saved(found["saved"])
    if "shapes" in expected:
        check_shapes(found["shapes"], expected)
    if "panels" in expected:
        check_response(found, expected)
        check_zoom(found["zoom"])
        check_drag(found["drag"])
        expect(found["table"] == {"rows": 10, "right": True}, f"table of the element: {found['table']}")
        check_diagrams(found["diagrams"], expected)
        check_correlated(found["correlated"], expected.get("correlated"), expected["lines"])
        if "comparison" in expected:
            check_comparison(found["comparison"], expected["comparison"], found["entries"])
        check_nyquist(found["nyquist"], expected["nyquist"])
        check_use(found["use"], expected, width)
    expect(found["timed_cycles"] == expected["timed_cycles"],
           f"histograms of {found['timed_cycles']} cycles instead of {expected['timed_cycles']}")
    if expected["modes"]:
        expect(found["rows"]["modes"] == expected["modes"], f"{found['rows']['modes']} modes in the table")


def check_look(page, work, kind):
    """At all widths, light and dark, and with the keyboard."""
    browser = open_page(page, ready="document.readyState === 'complete' && window.stageidReport.content !== undefined", still=True)
    browser.check_tab(kind)
    browser.evaluate("document.querySelector('#entry-legend button').focus()")
    browser.press("Enter")
    expect(browser.evaluate("document.activeElement.parentElement.id") == "entry-legend", "a trace that is switched has not the focus any more")
    browser.check_widths(work, "report", 1000)
    for picture in work.glob("report_*.png") if kind == "full" else ():
        colours = browser.evaluate(COLOURS % base64.b64encode(picture.read_bytes()).decode())
        expect(colours > 4000, f"the screenshot has only {colours} colours: {picture}")
    expect(browser.problems == [], f"console: {browser.problems}")
    browser.close()


def checks(sample, work, kind):
    work /= kind
    subprocess.run([sample, work, kind], check=True)
    page = work / "report.html"
    expected = json.loads((work / "expected.json").read_text(encoding="utf-8"))
    if kind in LARGEST_PAGE:
        expect(expected["panels"] * expected["lines"] == 4 * 13 * 4000, "the page is not of full size")
        expect(page.stat().st_size < LARGEST_PAGE[kind], f"the page has {page.stat().st_size} bytes")
    testable = with_self_test(page)
    for width in WIDTHS.get(kind, (1280, 390)):
        found = findings(testable, width)
        check_page(found, expected, width)
        print(f"{kind}, {width} pixels: {page.stat().st_size} bytes, sections {found['sections']}")
    check_look(page, work, kind)


if __name__ == "__main__":
    sys.exit(run(__doc__, checks, kind="full"))
