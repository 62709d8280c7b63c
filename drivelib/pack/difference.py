"""The difference page: committed, computed and difference side by side, worst first, as one static HTML file."""

import base64
import html
import shutil
import tempfile
from pathlib import Path

from matplotlib.testing.compare import compare_images

from drivelib import paths
from drivelib.pack import report
from drivelib.record import write_atomically

STYLE = """body{font:16px/1.5 sans-serif;margin:2rem;max-width:110rem} figure{display:inline-block;width:32%;margin:0}
img{max-width:100%;border:1px solid #999} td,th{padding:.2rem .8rem;text-align:left} li{overflow-wrap:anywhere}"""


def write_page(stage, chosen, problems, found, target):
    """Write ``target``/index.html: what differs, the pictures that differ, and every verdict of this run."""
    pictures = sorted(filter(None, (_compare(stage, id_) for id_ in chosen)), reverse=True)
    rows = [
        f"<tr><td>{html.escape(claim.id)}</td><td>{html.escape(report.ours(claim, result))}</td><td>{html.escape(verdict)}</td></tr>"
        for claim, result, verdict in report.rows(found)
    ]
    page = f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>Differences</title><style>{STYLE}</style>
<h1>Differences</h1><ul>{"".join(f"<li>{html.escape(line)}</li>" for line in problems)}</ul>
<h2>Pictures, worst first</h2>{"".join(text for _, text in pictures) or "<p>No picture differs.</p>"}
<h2>Verdicts of this run</h2><table><tr><th>claim</th><th>ours</th><th>verdict</th></tr>{"".join(rows)}</table></html>
"""
    write_atomically(target / "index.html", page.encode())


def _compare(stage, id_):
    """Return (RMS, HTML) for an item whose picture differs, else None."""
    committed, fresh = paths.figure(id_, "png"), stage / "figures" / f"{id_}.png"
    if not committed.exists() or not fresh.exists() or committed.read_bytes() == fresh.read_bytes():
        return None
    with tempfile.TemporaryDirectory() as folder:
        baseline, ours = Path(folder, "baseline.png"), Path(folder, "ours.png")
        shutil.copy(committed, baseline)
        shutil.copy(fresh, ours)
        result = compare_images(baseline, ours, tol=0, in_decorator=True)
        if result is None:  # other bytes, same pixels
            return None
        shown = {"committed": baseline, "computed": ours, "difference": Path(result.get("diff") or ours)}
        figures = "".join(
            f'<figure><img alt="{name} picture of {id_}" src="data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}">'
            f"<figcaption>{name}</figcaption></figure>"
            for name, path in shown.items()
            if path.exists()
        )
    return float(result["rms"]), f"<h3>{html.escape(id_)}: RMS {result['rms']:.2f} of 255</h3>{figures}"
