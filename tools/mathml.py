r"""Formulas of the documentation as MathML: `$…$` in a line, `$$…$$` on lines of their own.

A Markdown extension, after `pymdownx.arithmatex`, which finds the formulas. Browsers draw MathML
themselves: the site needs no script and asks no other host. What `\tag{n}` numbers gets the anchor
`eq-n`. A formula that LaTeX would not accept stops the build.
"""

from __future__ import annotations

import html
import re
from xml.etree.ElementTree import Element

from markdown import Markdown
from markdown.extensions import Extension
from markdown.treeprocessors import Treeprocessor
from math_core import LatexToMathML

_TAG = re.compile(r"\\tag\{(\d+)\}")
_AFTER_INLINE = 15  # inline patterns, which leave formulas alone, have priority 20


class Formulas(Treeprocessor):
    """Puts MathML where arithmatex left LaTeX."""

    def run(self, root: Element) -> None:
        """Replace the text of every formula of a page."""
        for element in root.iter():
            if element.get("class") == "arithmatex":
                self._typeset(element)

    def _typeset(self, element: Element) -> None:
        latex = html.unescape(element.text or "").strip()[2:-2].strip()  # without \( \) or \[ \]
        numbers = _TAG.findall(latex)
        mathml = LatexToMathML().convert_with_local_state(
            _TAG.sub("", latex), displaystyle=element.tag == "div"
        )
        element.text = self.md.htmlStash.store(mathml)
        if numbers:
            element.set("id", f"eq-{numbers[0]}")
            number = Element("a", {"class": "number", "href": f"#eq-{numbers[0]}"})
            number.text = f"({numbers[0]})"
            element.append(number)


class FormulasExtension(Extension):
    """Enters the treeprocessor."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Register behind arithmatex."""
        md.treeprocessors.register(Formulas(md), "formulas", _AFTER_INLINE)


def makeExtension(**kwargs: object) -> FormulasExtension:
    """What Markdown calls to load this module."""
    return FormulasExtension(**kwargs)
