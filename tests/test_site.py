"""The site as files: every link leads somewhere, nothing comes from elsewhere, every notebook, claim and module has its page."""

import base64
import csv
import hashlib
import json
import re
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest

from drivelib import ledger, notebook, paths
from drivelib.pack import architecture, report, site, site_notebooks, site_sphinx, site_text

RESOURCES = {("img", "src"), ("script", "src"), ("link", "href"), ("source", "src"), ("iframe", "src"), ("object", "data"), ("use", "href")}
VOID = {"img", "meta", "link", "input", "br", "hr", "col", "wbr", "source", "path", "rect", "line", "circle", "polyline", "polygon"}


class Page(HTMLParser):
    """What the tests ask of one page."""

    def __init__(self, path):
        super().__init__()
        self.ids, self.links, self.images, self.resources, self.maths = set(), [], [], [], 0
        self.title, self.lang, self.mains, self.headings, self.words, self._open = "", None, 0, 0, [], []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if tag not in VOID:
            self._open.append(tag)
        if values.get("id"):
            self.ids.add(values["id"])
        if tag == "a" and "href" in values:
            self.links.append(values["href"])
        if tag == "img":
            self.images.append(values)
        self.resources += [values[name] for kind, name in RESOURCES if kind == tag and values.get(name)]
        self.lang = values.get("lang") if tag == "html" else self.lang
        self.mains += tag == "main" or values.get("role") == "main"
        self.headings += tag == "h1"
        self.maths += tag == "math"

    def handle_endtag(self, tag):
        if tag in self._open:
            while self._open.pop() != tag:
                pass

    def handle_data(self, data):
        if self._open and self._open[-1] == "title" and "svg" not in self._open:
            self.title += data
        if not {"script", "style", "code", "pre", "head"} & set(self._open):
            self.words.append(data)


@pytest.fixture(scope="session")
def pages(built_site):
    """Every page of the site by its path."""
    return {path.relative_to(built_site).as_posix(): Page(path) for path in built_site.rglob("*.html")}


def test_every_internal_link_and_anchor_resolves(built_site, pages):
    broken = []
    for name, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or (not parts.path and not parts.fragment):
                continue
            target = (built_site / name).parent.joinpath(unquote(parts.path)).resolve() if parts.path else (built_site / name).resolve()
            if not target.is_file():
                broken.append((name, link))
            elif parts.fragment and target.suffix == ".html" and "=" not in parts.fragment:
                found = pages[target.relative_to(built_site.resolve()).as_posix()]
                if unquote(parts.fragment) not in found.ids:
                    broken.append((name, link))
    assert broken == []


def test_a_link_with_a_filter_names_values_that_the_page_has(built_site, pages):
    links = [link for link in pages["index.html"].links if "#paper=" in link]
    text = (built_site / "claims/index.html").read_text()
    known = {facet: set(re.findall(rf'class="facet-{facet}[^"]*">([^<]*)<', text)) for facet in ("paper", "verdict")}
    assert links
    for link in links:
        for pair in unquote(urlsplit(link).fragment).split("&"):
            facet, value = pair.split("=")
            assert value in known[facet], link


def test_nothing_is_loaded_from_elsewhere(built_site, pages):
    for name, page in pages.items():
        for resource in page.resources:
            assert not urlsplit(resource).netloc and urlsplit(resource).scheme in ("", "data"), (name, resource)
            if not resource.startswith(("data:", "#")):
                assert (built_site / name).parent.joinpath(unquote(urlsplit(resource).path)).is_file(), (name, resource)
    for sheet in built_site.rglob("*.css"):
        assert not re.search(r"(url\(|@import)\s*[\"']?(https?:)?//", sheet.read_text()), sheet


def test_every_image_is_described(pages):
    """Figures by the sentence that their notebook gives; 40 characters are the least that a notebook is allowed."""
    count = 0
    for name, page in pages.items():
        for image in page.images:
            count += 1
            assert len(image.get("alt", "")) >= 40, (name, image)
    assert count >= 2 * len(site_notebooks.found())  # in the notebook and in the gallery


def test_every_notebook_has_a_page_with_its_picture_data_and_claims(built_site, pages):
    for id_, path in site_notebooks.found().items():
        page, content = pages[f"notebooks/{id_}.html"], notebook.read(path)
        shown = [output for cell in content["cells"] for output in cell.get("outputs", ()) if "image/png" in output.get("data", {})]
        assert len(page.images) == len(shown)
        for output in shown:
            digest = hashlib.sha256(base64.b64decode("".join(output["data"]["image/png"]))).hexdigest()
            assert digest == json.loads(paths.figure(id_, "json").read_text())["artefacts"]["png"]
        if shown:
            stem = id_.split("/")[-1]
            suffixes = {link.rsplit(".", 1)[-1] for link in page.links if link.rsplit("/", 1)[-1].startswith(f"{stem}.")}
            assert {"csv", "svg", "png", "ipynb"} <= suffixes
            text = (built_site / f"notebooks/{id_}.html").read_text()
            assert text.count("<details") >= 2
            for claim_id in [claim_id for paper in ledger.papers().values() for claim_id, claim in paper.claims.items() if claim.item == id_]:
                assert any(link.endswith(f"claims/{claim_id}.html") for link in page.links), (id_, claim_id)


def test_every_claim_has_a_page_with_its_verdict_and_a_link_to_each_function(pages):
    for claim, _, verdict in report.rows(report.results()):
        page = pages[f"claims/{claim.id}.html"]
        text = " ".join("".join(page.words).split())
        assert verdict in text
        assert claim.where in text
        for function in claim.functions:
            assert any(link.endswith(f"#drivelib.{function}") for link in page.links), (claim.id, function)
        assert any(link.endswith(f"notebooks/{claim.item}.html") for link in page.links) or verdict == report.OPEN
        assert f"{claim.id}.html" in pages["claims/index.html"].links


def test_a_claim_that_was_drawn_at_random_says_in_which_share_it_holds(pages):
    path = paths.root() / "figures" / "beyond" / "claim_robustness.csv"
    rows = list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))
    assert rows
    for row in rows:
        text = " ".join("".join(pages[f"claims/{row['claim']}.html"].words).split())
        assert f"holds in {100 * float(row['share']):.1f} % of {int(row['draws']) - int(row['flagged'])} draws" in text


def test_every_module_has_a_page(built_site):
    package = paths.root() / "drivelib"
    for path in package.rglob("*.py"):
        name = path.relative_to(package).with_suffix("").as_posix()
        if path.read_text().strip():
            page = built_site / f"api/{architecture.module(name)}.html"
            assert "<h1>" in page.read_text()


def test_equations_are_mathml_everywhere_and_none_is_left_as_latex(built_site, pages):
    equations = 0
    for id_, path in site_notebooks.found().items():
        texts = []
        for cell in notebook.read(path)["cells"]:
            texts += [notebook.source(cell)] if cell["cell_type"] == "markdown" else []
            texts += ["".join(output.get("data", {}).get("text/markdown", "")) for output in cell.get("outputs", ())]
        written = sum(len(re.findall(r"\$\$.+?\$\$|\$[^$]+?\$", re.sub(r"`[^`]*`", "", text), re.DOTALL)) for text in texts)
        assert pages[f"notebooks/{id_}.html"].maths == written, id_
        equations += written
    assert equations > 200
    for name, page in pages.items():
        words = "".join(page.words)
        assert "$" not in words and not re.search(r"\\(frac|omega|left|text)", words), name


def test_an_equation_that_cannot_be_shown_stops_the_build():
    assert "<mfrac>" in site_sphinx.mathml(r"\frac{1}{R_c}")
    with pytest.raises(site_sphinx.EquationError, match="nosuchthing"):
        site_sphinx.mathml(r"\nosuchthing{x}")


def test_pages_have_language_title_heading_and_one_main_part(pages):
    titles = {}
    for name, page in pages.items():
        assert page.lang == "en", name
        assert titles.setdefault(page.title.strip(), name) == name
        assert page.headings >= 1 or name in ("genindex.html", "search.html"), name
        assert page.mains == 1 or name.startswith("difference/"), name


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")  # of Sphinx, in its own extensions
def test_a_broken_link_is_a_warning_and_a_second_build_says_it_again(tmp_path, monkeypatch):
    sources = {"index.md": b"# Start\n\n[nowhere](nowhere.md)\n"}
    monkeypatch.setattr(site, "_sources", lambda extra: sources)
    for _ in range(2):
        assert any("nowhere.md" in line for line in site.build(tmp_path / "html", tmp_path / "cache", jobs=1))


@pytest.mark.parametrize("text", ["a * b * c", "K_e, K_Δe, _x_", "|x| < 1 | y", "[no](link)", "$5 and $6", "1. *first*", "`code_1` stays"])
def test_plain_text_is_shown_as_it_is(text):
    from markdown_it import MarkdownIt

    found = []
    reader = HTMLParser()
    reader.handle_data = found.append
    reader.feed(MarkdownIt().render(f"So: {site_text.escaped(text)}"))
    assert "".join(found).strip() == f"So: {text.replace('`', '')}"


def test_links_into_the_repository_become_links_of_the_site():
    assert site_text.relinked("[`pmsm`](../../drivelib/pmsm.py)", 2) == "[`pmsm`](../../api/drivelib.pmsm.md)"
    assert site_text.relinked("[a](drivelib/papers/zidani.toml), [b](LICENSE)", 0) == "[a](papers/zidani.md), b"
    assert site_text.relinked("[fig](fig02_x.ipynb), [part](#there)", 2) == "[fig](fig02_x.ipynb), [part](#there)"


def test_the_table_behind_a_figure_says_what_its_columns_are(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("# t [s]: time\n# n [1]: names\nt,n\n" + "".join(f"{k / 10},a\n" for k in range(30)))
    table = site_notebooks.table(path)
    assert table["columns"] == [("t", "s", "time", "0", "2.9"), ("n", "1", "names", "", "")]
    assert (len(table["rows"]), table["count"]) == (site_notebooks.ROWS, 30)
