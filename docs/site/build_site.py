#!/usr/bin/python3
"""Builds the documentation as a web site: README.md, CONTRIBUTING.md, CHANGELOG.md and docs/, as they are.

    build_site.py SOURCE_DIR OUTPUT_DIR [--reference DIR]

Ends with exit code 1 on a warning of MkDocs and on every link within the site that leads nowhere. OUTPUT_DIR/html is
the site; --reference adds the C++ reference that Doxygen wrote to DIR.
"""

import argparse
import html.parser
import json
import pathlib
import re
import shutil
import subprocess
import sys
import urllib.parse

from pygments.formatters import HtmlFormatter

HERE = pathlib.Path(__file__).resolve().parent
KATEX = pathlib.Path("/usr/share/javascript/katex")
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
LINK = re.compile(r"(\]\()([^)#\s]+)((?:#[^)\s]*)?\))")
LANGUAGES = {".py": "python", ".c": "c", ".cpp": "cpp", ".hpp": "cpp", ".yaml": "yaml", ".cff": "yaml", ".txt": "text"}
NAVIGATION = [
    {"Overview": "README.md"},
    {"User guide": "docs/guide.md"},
    {"Troubleshooting": "docs/troubleshooting.md"},
    {"Reference": [
        {"Files": "docs/formats.md"},
        {"Exchange": "docs/exchange.md"},
        {"Python": "docs/python.md"},
        {"Examples": "docs/examples/README.md"},
        {"C++": "docs/cpp.md"},
    ]},
    {"Real stages": [
        {"Stops": "docs/stops.md"},
        {"CAN FD": "docs/can-protocol.md"},
        {"Modbus": "docs/modbus-map.md"},
        {"Plugins": "docs/plugins.md"},
    ]},
    {"Background": [
        {"Theory": "docs/theory.md"},
        {"Benchmarks": "docs/benchmarks.md"},
        {"Comparison": "docs/comparison.md"},
        {"Several processes": "docs/scale.md"},
    ]},
    {"Development": [
        {"Contributing": "CONTRIBUTING.md"},
        {"Changelog": "CHANGELOG.md"},
        {"Rooms": "docs/rooms.md"},
        {"Decisions": "docs/decisions/README.md"},
    ]},
]  # fmt: skip


def shown(path):
    """A fenced block of a file, longer than any fence within."""
    text = path.read_text()
    fence = "`" * max([3, *(len(found) + 1 for found in re.findall(r"`{3,}", text))])
    return f"{fence}{LANGUAGES.get(path.suffix, 'text')}\n{text.rstrip()}\n{fence}\n"


class Staging:
    """The pages in the tree that they have in the source; what they link to, but browsers do not show, as pages."""

    def __init__(self, source, folder):
        self.source, self.folder, self.made = source, folder, set()

    def fill(self):
        for page in (*PAGES, *(path.relative_to(self.source) for path in (self.source / "docs").rglob("*.md"))):
            target = self.folder / page
            target.parent.mkdir(parents=True, exist_ok=True)
            text = (self.source / page).read_text()
            target.write_text(LINK.sub(lambda link: self.linked(pathlib.Path(page).parent, link), text))

    def linked(self, folder, link):
        target = link[2]
        path = (self.source / folder / target).resolve()
        if urllib.parse.urlsplit(target).scheme or target.endswith(".md") or not path.is_relative_to(self.source):
            return link[0]
        name = path.relative_to(self.source)
        if path.is_dir():
            self.page(name / "README.md", name, [file for file in sorted(path.iterdir()) if file.is_file()])
            return f"{link[1]}{target.rstrip('/')}/README.md{link[3]}"
        if not path.is_file():
            return link[0]  # MkDocs reports it
        if path.suffix in (".png", ".svg"):
            (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, self.folder / name)
            return link[0]
        self.page(pathlib.Path(f"{name}.md"), name, [path])
        return f"{link[1]}{target}.md{link[3]}"

    def page(self, name, title, files):
        if name in self.made:
            return
        self.made.add(name)
        target = self.folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        heads = [f"## {file.name}\n\n" if len(files) > 1 else "" for file in files]
        target.write_text(f"# {title}\n\n" + "\n".join(head + shown(file) for head, file in zip(heads, files)))


def build(source, output, reference):
    shutil.rmtree(output, ignore_errors=True)
    pages, assets = output / "pages", output / "pages/assets"
    assets.mkdir(parents=True)
    Staging(source, pages).fill()
    for name in ("site.css", "math.js"):
        shutil.copyfile(HERE / name, assets / name)
    for name in ("katex.min.js", "katex.min.css"):
        shutil.copyfile(KATEX / name, assets / name)
    shutil.copytree(KATEX / "fonts", assets / "fonts")
    (assets / "code.css").write_text(HtmlFormatter().get_style_defs(".codehilite"))
    if reference:
        shutil.copytree(reference, pages / "reference")
        with (pages / "docs/cpp.md").open("a") as page:
            page.write("\nEvery class and function: [C++ reference](../reference/index.html).\n")
    config = {
        "site_name": "stageid",
        "docs_dir": str(pages),
        "site_dir": str(output / "html"),
        "use_directory_urls": False,  # so that the site works as files, without a server
        "theme": {"name": None, "custom_dir": str(HERE / "theme")},
        "plugins": [],
        "nav": NAVIGATION,
        "hooks": [str(HERE / "hooks.py")],
        "markdown_extensions": ["tables", "fenced_code", "sane_lists", {"codehilite": {"guess_lang": False}}],
        "extra_css": ["assets/katex.min.css", "assets/code.css", "assets/site.css"],
        "extra_javascript": ["assets/katex.min.js", "assets/math.js"],
    }
    (output / "mkdocs.yml").write_text(json.dumps(config, indent=1))
    done = subprocess.run(["mkdocs", "build", "--strict", "--config-file", output / "mkdocs.yml"],
                          capture_output=True, text=True)  # fmt: skip
    if done.returncode != 0:
        told = [line for line in done.stderr.splitlines() if not line.startswith(("INFO", "  - "))]
        sys.exit("\n".join(told))


class Page(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.links, self.names = [], set()
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        for key, value in attributes:
            if key in ("href", "src") and value:
                self.links.append((tag, value))
            if key in ("id", "name") and value:
                self.names.add(value)


def broken_links(site):
    """Links to what the site lacks; and what it would load from elsewhere, since it is to work without a network."""
    pages = {path: Page(path) for path in site.rglob("*.html") if "reference" not in path.relative_to(site).parts}
    for path, page in pages.items():
        for tag, link in page.links:
            parts = urllib.parse.urlsplit(link)
            if parts.scheme or parts.netloc:
                if tag != "a":
                    yield f"{path.relative_to(site)}: loads {link}"
                continue
            target = (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path
            fragment = urllib.parse.unquote(parts.fragment)
            if not target.is_file():
                yield f"{path.relative_to(site)}: no such file: {link}"
            elif fragment and target in pages and fragment not in pages[target].names:
                yield f"{path.relative_to(site)}: no such heading: {link}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--reference", type=pathlib.Path)
    options = parser.parse_args()
    build(options.source.resolve(), options.output.resolve(), options.reference)
    broken = sorted(set(broken_links(options.output.resolve() / "html")))
    if broken:
        sys.exit("\n".join(broken))
    print(options.output / "html/index.html")


if __name__ == "__main__":
    main()
