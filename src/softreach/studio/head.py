"""Our title, our rules for small windows, and when fields apply, in the head of viser's page."""

from __future__ import annotations

import gzip
from functools import lru_cache

__all__ = ["headed", "headed_body"]

_THEIRS = "<title>Viser</title>"
# viser's sheet for phones leaves a third of the width unused, and tabs break into two lines.
_OURS = """<title>softreach</title><style>
[role="tab"]{padding-inline:0.24em!important;font-size:0.73rem!important}
input{text-overflow:ellipsis}
@media (max-width:36em){
div[style*="position: fixed"][style*="max-height: 60%"]{
width:100%!important;max-height:50%!important}
div[style*="position: fixed"][style*="max-height: 60%"] div[style*="width: 20em"]{
width:100%!important}
}</style>"""
# viser drops what a field tells if Enter follows at once; and fields that are left apply too.
_KEYS = """<script>(function(){
function apply(form){form.typed=false;setTimeout(function(){
if(form.isConnected)form.requestSubmit()},120)}
addEventListener("input",function(e){if(e.target.form)e.target.form.typed=true},true);
addEventListener("keydown",function(e){var form=e.target.form;
if(form&&e.key==="Enter"){e.preventDefault();e.stopPropagation();apply(form)}},true);
addEventListener("focusout",function(e){var form=e.target.form;
if(form&&form.typed)apply(form)},true)})()</script>"""


def headed(page: str) -> str:
    """A page with our head."""
    return page.replace(_THEIRS, _OURS + _KEYS, 1)


@lru_cache(maxsize=4)
def headed_body(body: bytes, *, zipped: bool) -> bytes:
    """The same for what is sent of a page; anything else as it is."""
    content = gzip.decompress(body) if zipped else body
    ours = content.replace(_THEIRS.encode(), (_OURS + _KEYS).encode(), 1)
    if ours == content:
        return body
    return gzip.compress(ours) if zipped else ours
