"""Our title, rules for small windows and dark ones, when fields apply: the head of viser's page."""

from __future__ import annotations

import gzip
from functools import lru_cache

__all__ = ["headed", "headed_body"]

_THEIRS = "<title>Viser</title>"
# viser's sheet for phones leaves a third of the width unused, and tabs break into two lines.
# Eleven tabs just fit; where they do not, the line can be moved.
_OURS = """<title>softreach</title><style>
[role="tablist"]:has([role="tab"]){flex-wrap:nowrap!important;overflow-x:auto;scrollbar-width:none}
[role="tab"]{padding-inline:0.15em!important;font-size:0.73rem!important;flex:1 0 auto!important}
[role="tab"]:only-of-type{flex:none!important}
input{text-overflow:ellipsis}
@media (max-width:36em){
div[style*="position: fixed"][style*="max-height: 60%"]{
width:100%!important;max-height:50%!important}
div[style*="position: fixed"][style*="max-height: 60%"] div[style*="width: 20em"]{
width:100%!important}
div[style*="position: fixed"][style*="max-height: 60%"] .mantine-ScrollArea-content{
display:block!important;width:100%!important;min-width:0!important}
div[style*="position: fixed"][style*="max-height: 60%"] div[style*="grid-template-rows"]{
grid-template-columns:minmax(0,1fr)}
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
# viser writes black on white whatever the page looks like; its two shaders for that get a switch.
_LABELS = """<script>(function(){
var gl=window.WebGL2RenderingContext&&WebGL2RenderingContext.prototype;if(!gl)return;
var source=gl.shaderSource,attach=gl.attachShader,use=gl.useProgram;
var shaders=new WeakSet(),programs=new WeakMap();
gl.shaderSource=function(shader,text){
var ours=text.replace("vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)",
"vec4(vec3(1.0 - 0.92 * isDark), 0.85 * vAlpha)").replace("vec4(0.0, 0.0, 0.0, a)",
"vec4(vec3(0.85 * isDark), a)");
if(ours!==text){shaders.add(shader);
ours=ours.replace("void main","uniform float isDark; void main")}
source.call(this,shader,ours)};
gl.attachShader=function(program,shader){
if(shaders.has(shader))programs.set(program,null);attach.call(this,program,shader)};
gl.useProgram=function(program){use.call(this,program);
if(!program||!programs.has(program))return;
var place=programs.get(program)||this.getUniformLocation(program,"isDark");
programs.set(program,place);
this.uniform1f(place,document.documentElement.dataset.mantineColorScheme==="dark"?1:0)}})()</script>"""
_HEAD = _OURS + _KEYS + _LABELS


def headed(page: str) -> str:
    """A page with our head."""
    return page.replace(_THEIRS, _HEAD, 1)


@lru_cache(maxsize=4)
def headed_body(body: bytes, *, zipped: bool) -> bytes:
    """The same for what is sent of a page; anything else as it is."""
    content = gzip.decompress(body) if zipped else body
    ours = content.replace(_THEIRS.encode(), _HEAD.encode(), 1)
    if ours == content:
        return body
    return gzip.compress(ours) if zipped else ours
