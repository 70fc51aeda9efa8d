"""Draws the steps of a search for modes: the cost after each decision, as model.json records it.

usage: search_steps.py MODEL.json PICTURE.svg        (needs python3-matplotlib)

docs/images/search_steps.svg is of the quick wafer stage:
    stageid identify configs/experiment/wafer_stage_quick.yaml -o quick
    stageid fit quick/frf.h5 --band 20 2000 -o quick.json
"""

import json
import re
import sys

import matplotlib

matplotlib.use("svg")
matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "stageid"})
import matplotlib.pyplot as plt  # noqa: E402

PART = re.compile(r"^(\d+ of \d+ lines): ")
COST = re.compile(r"^(.*?): cost (\S+) -> ([^\s,]+)")


def steps_of(decisions):
    """(text, cost, whether on a part of the lines); what is dropped or added together is one step."""
    steps, part = [], None
    for decision in decisions:
        found = COST.match(PART.sub("", decision))
        if not found or decision.startswith(("cost:", "residue")):
            continue
        text, before, after = found[1], float(found[2]), float(found[3])
        on_part = PART.match(decision)
        if not steps:
            steps.append(("peaks of the CMIF", before, True))
        if part and not on_part:
            steps.append(("all lines", before, False))
        part = on_part
        text = re.sub(r"^structure: ", "", text)
        text = re.sub(r"^(added|dropped) ([\d.]+) Hz.*", r"\1 \2 Hz", text)
        if steps[-1][1] == after and text.split()[0] in ("added", "dropped"):
            text = steps[-1][0] + ", " + text.split(maxsplit=1)[1]
            steps.pop()
        steps.append((text, after, bool(on_part)))
    return steps


def short(text):
    verb, *places = text.split(", ")
    return verb if not places else f"{verb.split()[0]} {len(places) + 1} modes"


def draw(steps, picture):
    costs = sorted(cost for _, cost, _ in steps)
    right = costs[0] + 1.3 * (next((c for c in reversed(costs) if c < 10.0 * costs[0]), costs[0]) - costs[0])
    figure, axes = plt.subplots(figsize=(8.0, 0.32 * len(steps) + 1.0))
    axes.plot([min(cost, right) for _, cost, _ in steps], range(len(steps)), color="0.75", zorder=1)
    for of_part, colour, label in ((True, "tab:blue", "part of the lines"), (False, "tab:orange", "all lines")):
        chosen = [(min(cost, right), i) for i, (_, cost, part) in enumerate(steps) if part == of_part]
        axes.scatter(*zip(*chosen), color=colour, label=label, zorder=2)
    for i, (_, cost, _) in enumerate(steps):
        axes.annotate(f"{cost:.5g}", (min(cost, right), i), (6, 0), textcoords="offset points", va="center")
    axes.set_yticks(range(len(steps)), [short(text) for text, _, _ in steps])
    axes.invert_yaxis()
    axes.set_xlim(costs[0] - 0.05 * (right - costs[0]), right + 0.1 * (right - costs[0]))
    axes.set_xlabel("cost; the first one is far beyond")
    axes.grid(axis="x", alpha=0.3)
    axes.legend(loc="lower right")
    figure.tight_layout()
    figure.savefig(picture, metadata={"Date": None})


def main():
    model, picture = sys.argv[1:]
    with open(model, encoding="utf-8") as file:
        read = json.load(file)
    steps = steps_of(read["provenance"]["decisions"])
    draw([*steps, ("last fit", read["fit"]["cost"], False)], picture)


if __name__ == "__main__":
    main()
