"""The difference page: what differs by layer, then old, new and difference of each picture, worst first; one static file."""

import base64
import html
import tempfile
from pathlib import Path

from drivelib import paths
from drivelib.pack import layers, report
from drivelib.record import write_atomically

STYLE = """:root{color-scheme:light dark} body{color:CanvasText;background:Canvas;font:16px/1.5 sans-serif;margin:2rem;max-width:110rem}
figure{display:inline-block;width:32%;margin:0} @media(max-width:40rem){body{margin:1rem} figure{width:100%}} div{overflow-x:auto}
img{max-width:100%;border:1px solid #999;background:#fff} td,th{padding:.2rem .8rem;text-align:left;vertical-align:top} td{overflow-wrap:break-word}
input{font:inherit;width:24rem;max-width:100%} [hidden]{display:none}"""
FILTER = """document.getElementById("filter").addEventListener("input",function(){
var wanted=this.value.toLowerCase().split(/\\s+/);
document.querySelectorAll("[data-text]").forEach(function(row){
row.hidden=!wanted.every(function(word){return row.dataset.text.toLowerCase().includes(word);});});});"""


def write_page(old_root, new_root, chosen, problems, target):
    """Write ``target``/index.html on what differs between two trees; return the differences.

    ``problems`` are lines to show above them, such as failures of the run.
    """
    found = layers.compare(old_root, new_root, chosen)
    shown = [_pictures(old_root, new_root, one) for one in found if one.layer == "pictures" and one.what.startswith("the picture")]
    rows = "".join(
        f'<tr data-text="{html.escape(f"{one.layer} {one.item} {one.what}")}"><td>{one.layer}</td><td>{html.escape(one.item)}</td>'
        f"<td>{html.escape(one.what)}</td></tr>"
        for one in found
    )
    now = report.results(Path(new_root) / "figures", broken="skip")
    verdicts = "".join(
        f'<tr data-text="{html.escape(f"verdict {claim.id} {verdict}")}"><td>{html.escape(claim.id)}</td>'
        f"<td>{html.escape(report.ours(claim, result))}</td><td>{html.escape(verdict)}</td></tr>"
        for claim, result, verdict in report.rows(now)
        if claim.item in chosen
    )
    page = f"""<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>Differences, old beside new</title><style>{STYLE}</style>
<h1>Differences</h1><p><label>Show only what contains <input id="filter" type="search"></label></p>
<ul>{"".join(f'<li data-text="{html.escape(line)}">{html.escape(line)}</li>' for line in problems)}</ul>
<h2>By layer, worst first</h2><p>Numbers decide, pictures inform.</p>
{f"<div><table><tr><th>layer</th><th>item</th><th>old → new</th></tr>{rows}</table></div>" if rows else "<p>Nothing differs.</p>"}
<h2>Pictures, worst first</h2>{"".join(shown) or "<p>No picture differs.</p>"}
<h2>Verdicts of the new files</h2><div><table><tr><th>claim</th><th>ours</th><th>verdict</th></tr>{verdicts}</table></div>
<script>{FILTER}</script></html>
"""
    write_atomically(Path(target) / "index.html", page.encode())
    return found


def _pictures(old_root, new_root, one):
    """Return the HTML of one picture that differs."""
    old, new = (layers.files(root, one.item)["png"] for root in (old_root, new_root))
    with tempfile.TemporaryDirectory() as folder:
        result = layers.picture_difference(old, new, folder) or {}
        shown = {"old": old, "new": new} | ({"difference": Path(result["diff"])} if result.get("diff") else {})
        figures = "".join(
            f'<figure><img alt="{name} picture of {one.item}" src="data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}">'
            f"<figcaption>{name}</figcaption></figure>"
            for name, path in shown.items()
        )
    title = html.escape(f"{one.item}: {one.what}")
    return f'<section data-text="{title}"><h3>{title}</h3>{figures}</section>'


def default_folder():
    """Return where the page goes when nobody says otherwise."""
    return paths.build("difference")
