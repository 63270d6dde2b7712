"""The part of Sphinx that is the site's own: links from citations, paths and types, formulas without scripts."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from html import unescape
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.util import logging

from sitemaker.citations import citations
from sitemaker.sources import NAMED, page_of

_MATHML = "http://www.w3.org/1998/Math/MathML"
_ACCENTS = tuple("~ˆ¯")
ElementTree.register_namespace("", _MATHML)
_PAGE = re.compile(r"(?<![\w/.-])docs/([\w/-]+)\.md\b")  # as docstrings and the help of commands name a page
_LOG = logging.getLogger(__name__)
_NO_LINKS = (nodes.reference, nodes.title, nodes.literal, nodes.literal_block, nodes.raw, nodes.math, nodes.citation)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register it with Sphinx."""
    app.connect("doctree-resolved", _link)
    app.add_role("pytype", _type)
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _link(app: Sphinx, document: nodes.document, page: str) -> None:
    for text in list(document.findall(nodes.Text)):
        if not _inside(text, _NO_LINKS):
            _link_text(app, text, page)
    for literal in list(document.findall(nodes.literal)):
        if not _inside(literal, (nodes.reference, nodes.title)):
            _link_file(app, literal, page)


def _inside(node: nodes.Node, kinds: tuple[type, ...]) -> bool:
    parent = node.parent
    while parent is not None:
        if isinstance(parent, kinds) or "sig" in getattr(parent, "attributes", {}).get("classes", ()):
            return True
        parent = parent.parent
    return False


def _link_text(app: Sphinx, text: nodes.Text, page: str) -> None:
    """Link the citations in a text, and replace paths of pages by links with their titles."""
    told = text.astext()
    parts: list[nodes.Node] = []
    last = 0
    for start, end, words, target, kind in sorted([*_cited(app, told, page), *_named_pages(app, told, page)]):
        parts += [nodes.Text(told[last:start])] if start > last else []
        parts.append(nodes.reference("", words, internal=True, refuri=target, classes=[kind] if kind else []))
        last = end
    if parts:
        text.parent.replace(text, [*parts, nodes.Text(told[last:])])


_Link = tuple[int, int, str, str, str]


def _cited(app: Sphinx, told: str, page: str) -> Iterator[_Link]:
    for cited in citations(told) if page != "references" else ():
        if cited.key is not None:
            target = f"{_uri(app, page, 'references')}#{cited.key.lower()}"
            yield cited.start, cited.end, told[cited.start : cited.end], target, "cited"


def _named_pages(app: Sphinx, told: str, page: str) -> Iterator[_Link]:
    for match in _PAGE.finditer(told):
        if match[1] in app.env.found_docs and match[1] != page:
            yield match.start(), match.end(), app.env.titles[match[1]].astext(), _uri(app, page, match[1]), ""


def _link_file(app: Sphinx, literal: nodes.literal, page: str) -> None:
    told = literal.astext()
    if re.search(r"[*?<]", told):
        return
    match, named = NAMED.search(told), _PAGE.fullmatch(told)
    target = page_of(match[0]) if match is not None else "" if named is None else named[1]
    if target in app.env.found_docs and target != page:
        link = nodes.reference("", "", internal=True, refuri=_uri(app, page, target))
        literal.replace_self(link)
        link += literal


def _type(name: str, raw: str, text: str, *more: Any) -> tuple[list[nodes.Node], list[nodes.system_message]]:
    """The role of a Python type: code in which each class of homofact is its bare name with a link to its page."""
    code = nodes.literal(raw)
    for part in re.split(r"(homofact(?:\.\w+)+)", text):
        short = nodes.Text(part.rpartition(".")[2])
        known = part.startswith("homofact.")
        code += pending_xref("", short, refdomain="py", reftype="class", reftarget=part) if known else nodes.Text(part)
    return [code], []


def _uri(app: Sphinx, page: str, target: str) -> str:
    return app.builder.get_relative_uri(page, target)


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_mathml(node, False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    numbered = f' id="{node["ids"][0]}"' if node["ids"] else ""
    translator.body.append(f'<div class="formula"{numbered}>{_mathml(node, True)}</div>')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, block: bool) -> str:
    try:
        return with_accents(tex2mathml(node.astext(), as_block=block))
    except MathError as error:
        _LOG.warning(f"formula: {error}", location=node)
        return ""


def with_accents(mathml: str) -> str:
    """The formula with the index of an accented letter beside it, where docutils puts it under the letter."""
    # Entities of HTML's (&lang;) are none of XML's, but for five.
    root = ElementTree.fromstring(re.sub(r"&(?!amp;|lt;|gt;|quot;|apos;)\w+;", lambda name: unescape(name[0]), mathml))
    for node in root.iter(f"{{{_MATHML}}}munderover"):
        base, index, over = node
        if over.tag.endswith("}mo") and over.text in _ACCENTS:
            letter = ElementTree.Element(f"{{{_MATHML}}}mover", {"accent": "true"})
            letter.extend((base, over))
            node[:] = (letter, index)
            node.tag = f"{{{_MATHML}}}msub"
    return ElementTree.tostring(root, encoding="unicode")
