"""What GitHub's Markdown has and Python-Markdown lacks: mathematics, and lists indented by two."""

import html
import re

CODE = re.compile(r"^(`{3,})(\w*)\n(.*?)^\1$\n?|(`+)(?!`)(.+?)(?<!`)\4(?!`)", re.DOTALL | re.MULTILINE)
MATH = re.compile(r"\$(?!\s)([^$\n]+?)(?<!\s)\$")
formulas = []


def keep(formula, block):
    """A word that Markdown leaves alone, in place of a formula."""
    formulas.append((formula, block))
    return f"formulanumber{len(formulas) - 1}x"


def inline(text):
    text = MATH.sub(lambda found: keep(found[1], False), text)
    return re.sub(r"^  (?=[-*] )", "    ", text, flags=re.MULTILINE)


def on_page_markdown(markdown, **_):
    """Formulas become words, outside of code."""
    parts, at = [], 0
    # $`...`$ looks like code otherwise.
    markdown = re.sub(r"\$`(.+?)`\$", lambda found: keep(found[1], False), markdown)
    markdown = re.sub(r"\$\$(.+?)\$\$", lambda found: keep(found[1], True), markdown, flags=re.DOTALL)
    for code in CODE.finditer(markdown):
        parts.append(inline(markdown[at : code.start()]))
        parts.append(f"\n{keep(code[3], True)}\n" if code[2] == "math" else code[0])
        at = code.end()
    return "".join(parts) + inline(markdown[at:])


def on_page_content(content, **_):
    def formula(found):
        text, block = formulas[int(found[1])]
        return f'<span class="math{" block" if block else ""}">{html.escape(text.strip())}</span>'

    return re.sub(r"formulanumber(\d+)x", formula, content)
