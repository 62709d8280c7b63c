"""The site in a real browser, from file://: console, requests, search, filter, keyboard, themes, contrast, phone."""

from urllib.parse import quote

import pytest
from browser import Browser, executable

from drivelib import ledger

pytestmark = pytest.mark.browser

ZIDANI = ledger.papers()["zidani"].name
PAGES = (
    "index.html",
    "gallery.html",
    "claims/index.html",
    "claims/zidani/eq02.html",
    "papers/eskander.html",
    "claims/eskander/index.html",
    "notebooks/zidani/fig10_speed.html",
    "notebooks/zidani/tab02_error_indices.html",
    "notebooks/eskander/fig08_minimum_loss.html",
    "notebooks/index.html",
    "notebooks/beyond/errata.html",
    "api/index.html",
    "api/drivelib.pmsm.html",
    "_modules/drivelib/pmsm.html",
    "genindex.html",
    "search.html?q=inverter+angle",
    "differences.html",
    "difference/index.html",
)
# What reaches beyond the right edge of a phone and stands in no box of its own that scrolls: nobody could read it.
CUT_OFF = """[...document.querySelectorAll("article *")].filter((e) => e.checkVisibility() && e.getBoundingClientRect().right > innerWidth + 1)
  .filter((e) => { for (let p = e; p && p.tagName !== "ARTICLE"; p = p.parentElement)
    if (["auto", "scroll"].includes(getComputedStyle(p).overflowX)) return false; return true; })
  .map((e) => e.tagName + "." + e.className + " " + e.textContent.slice(0, 40))"""
# Words of a table that a line break cuts in two; names of code may be cut.
TORN = r"""[...document.querySelectorAll("td")].filter((cell) => cell.checkVisibility()).flatMap((cell) => {
  const torn = [], walk = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    if (walk.currentNode.parentElement.closest("code, a, .indextable")) continue;
    for (const word of walk.currentNode.data.matchAll(/\p{L}+/gu)) {
      const range = document.createRange();
      range.setStart(walk.currentNode, word.index);
      range.setEnd(walk.currentNode, word.index + word[0].length);
      if (range.getClientRects().length > 1) torn.push(word[0]);
    }
  }
  return torn;
})"""
# Contrast of every visible text against what lies behind it, as WCAG 2.1 counts it (1.4.3): 4.5, for large text 3.
CONTRAST = """(() => {
  const parse = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return n.length < 4 ? [...n, 1] : n; };
  const over = (top, below) => [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3]));
  const light = (c) => { const [r, g, b] = c.map((v) => v / 255).map((v) => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const behind = (node) => { const layers = []; for (let e = node; e; e = e.parentElement) layers.push(parse(getComputedStyle(e).backgroundColor));
    return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255]); };
  const poor = new Map(); let count = 0;
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const element = walk.currentNode.parentElement, style = getComputedStyle(element);
    if (!walk.currentNode.textContent.trim() || !element.checkVisibility({ checkOpacity: true, checkVisibilityCSS: true })) continue;
    if (element.closest("svg, script, style, noscript")) continue;
    count += 1;
    let opacity = 1;
    for (let e = element; e; e = e.parentElement) opacity *= Number(getComputedStyle(e).opacity);
    const back = behind(element), ink = parse(style.color), front = over([ink[0], ink[1], ink[2], ink[3] * opacity], back);
    const [a, b] = [light(front), light(back)], ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    const size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5)) poor.set(element.tagName + "." + element.className + " " + ink + " on " + back.map(Math.round),
      ratio.toFixed(2) + " " + walk.currentNode.textContent.trim().slice(0, 40));
  }
  return { count, poor: [...poor].map(([where, what]) => where + ": " + what) };
})()"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    program = executable()
    if program is None:
        pytest.skip("needs a Chromium (chromium, google-chrome), which is not installed")
    started = Browser(program, tmp_path_factory.mktemp("browser"))
    yield started
    started.close()


@pytest.fixture
def tab(browser, built_site):
    """The tab at the size of a desk, light; ``visit`` opens a page of the site."""
    browser.resize(1400, 900)
    browser.prefer("light")
    browser.visit = lambda page: browser.open(f"{built_site.as_uri()}/{page}")
    return browser


@pytest.mark.parametrize("page", PAGES)
def test_a_page_opens_without_a_complaint_a_request_elsewhere_or_a_broken_picture(tab, page):
    tab.visit(page)
    assert tab.complaints() == []
    assert tab.requests() and [url for url in tab.requests() if not url.startswith(("file:", "data:"))] == []
    assert tab.evaluate("[...document.images].filter((image) => !image.naturalWidth).map((image) => image.src)") == []


@pytest.mark.parametrize("page", PAGES)
def test_the_body_of_a_page_never_scrolls_sideways_on_a_phone(tab, page):
    tab.resize(375, 800)
    tab.visit(page)
    assert tab.evaluate("document.documentElement.scrollWidth") <= 375
    assert tab.evaluate(CUT_OFF) == []
    assert tab.evaluate(TORN) == []


def test_the_check_of_torn_words_sees_one(tab):
    tab.open("data:text/html," + quote("<table style='width:40px;table-layout:fixed;overflow-wrap:anywhere'><td>reproduced <code>long_name</code>"))
    assert tab.evaluate(TORN) == ["reproduced"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("page", PAGES)
def test_text_has_enough_contrast(tab, page, scheme):
    tab.prefer(scheme)
    tab.visit(page)
    found = tab.evaluate(CONTRAST)
    assert found["count"] > 10
    assert found["poor"] == []


def test_the_contrast_check_sees_what_is_too_pale(tab):
    tab.open("data:text/html," + quote("<body style='background:%23fff'><p style='color:#777'>pale 4.48</p><p style='color:#767676'>right 4.54</p>".replace("%23", "#")))
    (poor,) = tab.evaluate(CONTRAST)["poor"]
    assert "4.48 pale" in poor


def test_the_dark_theme_is_dark_and_figures_keep_white_paper(tab):
    tab.prefer("dark")
    tab.visit("notebooks/eskander/fig08_minimum_loss.html")
    red = tab.evaluate("Number(getComputedStyle(document.body).backgroundColor.match(/\\d+/)[0])")
    assert red < 60
    assert tab.evaluate("[...new Set([...document.querySelectorAll('article img')].map((i) => getComputedStyle(i).backgroundColor))]") == ["rgb(255, 255, 255)"]


def test_the_search_finds_the_figure_of_the_inverter_angle(tab):
    tab.visit("search.html?q=inverter+angle")
    tab.until("document.querySelectorAll('#search-results li a').length > 3")
    first = tab.evaluate("[...document.querySelectorAll('#search-results li a')].slice(0, 3).map((a) => a.href)")
    assert any("fig16_inverter_angle.html" in link for link in first)
    assert tab.complaints() == []
    tab.evaluate("document.querySelector('#search-results a[href*=fig16_inverter_angle]').click()")
    tab.until("location.href.includes('/notebooks/eskander/fig16_inverter_angle') && document.querySelector('h1') !== null")


def test_the_gallery_filters_and_the_address_keeps_the_filter(tab):
    def shown():
        return tab.evaluate("[...document.querySelectorAll('figure.card')].filter((card) => card.checkVisibility()).length")

    def choose(name, value):
        tab.evaluate(f"(() => {{ const c = document.querySelector('form.filter').elements[{name!r}]; c.value = {value!r}; c.dispatchEvent(new Event('input', {{bubbles: true}})); }})()")

    def with_facets(**wanted):
        script = " && ".join(f"[...card.querySelectorAll('.facet-{facet}')].some((f) => f.textContent === {value!r})" for facet, value in wanted.items())
        return tab.evaluate(f"[...document.querySelectorAll('figure.card')].filter((card) => {script}).length")

    tab.visit("gallery.html")
    whole = shown()
    choose("verdict", "contradicted")
    assert 0 < shown() == with_facets(verdict="contradicted") < whole
    choose("paper", ZIDANI)
    assert 0 < shown() == with_facets(verdict="contradicted", paper=ZIDANI)
    assert tab.evaluate("document.querySelector('form.filter output').textContent") == f"{shown()} of {whole}"
    address, some = tab.evaluate("location.href"), shown()
    tab.open(address)
    assert shown() == some
    tab.evaluate("document.querySelector('form.filter button[type=reset]').click()")
    tab.until(f"[...document.querySelectorAll('figure.card')].filter((card) => card.checkVisibility()).length === {whole}")
    assert "#" not in tab.evaluate("location.href")
    choose("text", "low speed")
    assert 0 < shown() < whole


def test_without_script_the_gallery_is_a_plain_list(tab):
    tab.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        tab.visit("gallery.html")
        root = tab.call("DOM.getDocument", depth=0)["root"]["nodeId"]
        cards = tab.call("DOM.querySelectorAll", nodeId=root, selector="figure.card a")["nodeIds"]
        forms = tab.call("DOM.querySelectorAll", nodeId=root, selector="form.filter")["nodeIds"]
    finally:
        tab.call("Emulation.setScriptExecutionDisabled", value=False)
    assert len(cards) > 30 and not forms


def test_a_link_of_the_start_page_opens_the_claims_with_its_filter_set(tab):
    tab.visit("index.html")
    link, count = tab.evaluate("(() => { const a = [...document.querySelectorAll('a[href*=\"paper=Zidani\"][href*=\"verdict=contradicted\"]')][0]; return [a.href, a.textContent]; })()")
    tab.open(link)
    rows = tab.evaluate("[...document.querySelectorAll('.filterable tbody tr')].filter((row) => row.checkVisibility()).map((row) => row.innerText)")
    assert len(rows) == int(count) and all("contradicted" in row and ZIDANI in row for row in rows)


def test_the_table_of_claims_sorts(tab):
    tab.visit("claims/index.html")
    column = "[...document.querySelectorAll('.filterable tbody tr')].map((row) => row.cells[4].textContent.trim())"
    for order in ("ascending", "descending"):
        tab.evaluate("document.querySelectorAll('button.sort')[4].click()")
        assert tab.evaluate("document.querySelectorAll('.filterable th')[4].getAttribute('aria-sort')") == order
        assert tab.evaluate(column) == sorted(tab.evaluate(column), reverse=order == "descending")


def test_the_keyboard_reaches_a_card_shows_where_it_is_and_opens_it(tab):
    tab.visit("gallery.html")
    tab.evaluate("document.querySelector('form.filter button[type=reset]').focus()")
    for kind in ("rawKeyDown", "keyUp"):
        tab.call("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9)
    where = tab.evaluate("(() => { const e = document.activeElement, s = getComputedStyle(e); return [e.closest('figure.card') !== null, s.outlineStyle, parseFloat(s.outlineWidth)]; })()")
    assert where[0] and where[1] == "solid" and where[2] >= 2
    for kind in ("keyDown", "keyUp"):
        tab.call("Input.dispatchKeyEvent", type=kind, key="Enter", code="Enter", text="\r", windowsVirtualKeyCode=13)
    tab.until("location.href.includes('/notebooks/')")


def test_equations_take_room_and_fractions_stand_above_one_another(tab):
    tab.visit("notebooks/zidani/fig03_speed_loop.html")
    sizes = tab.evaluate("[...document.querySelectorAll('article math')].map((m) => m.getBoundingClientRect().height)")
    assert sizes and min(sizes) > 5
    above = tab.evaluate("[...document.querySelectorAll('article mfrac')].map((f) => f.children[0].getBoundingClientRect().bottom <= f.children[1].getBoundingClientRect().top + 1)")
    assert above and all(above)
