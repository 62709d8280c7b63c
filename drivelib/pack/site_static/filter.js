// Filters and sorts what a page lists. Without it the page is the plain list.
// The filter stands in the address (#paper=…&verdict=…), so that a link can carry it.
(function () {
  "use strict";

  function element(name, attributes, text) {
    const made = document.createElement(name);
    Object.entries(attributes || {}).forEach(([key, value]) => made.setAttribute(key, value));
    if (text) made.textContent = text;
    return made;
  }

  function values(entry, facet) {
    return [...entry.querySelectorAll(".facet-" + facet)].map((found) => found.textContent.trim());
  }

  function filterable(container, number) {
    const entries = [...container.querySelectorAll("figure, tbody tr")];
    const form = element("form", { class: "filter", role: "search", "aria-label": "Filter" });
    const controls = {};
    ["paper", "topic", "verdict"].forEach((facet) => {
      const known = [...new Set(entries.flatMap((entry) => values(entry, facet)))].filter(Boolean);
      if (known.length < 2) return;
      const label = element("label", {}, facet);
      const select = element("select", { name: facet });
      select.append(element("option", { value: "" }, "all"), ...known.map((value) => element("option", { value }, value)));
      label.append(select);
      form.append(label);
      controls[facet] = select;
    });
    const label = element("label", {}, "text");
    controls.text = element("input", { type: "search", name: "text" });
    label.append(controls.text);
    const count = element("output", { "aria-live": "polite" });
    form.append(label, element("button", { type: "reset" }, "show all"), count);
    container.prepend(form);

    function apply() {
      const words = controls.text.value.toLowerCase().split(/\s+/);
      let shown = 0;
      entries.forEach((entry) => {
        const fits = Object.entries(controls).every(([facet, control]) =>
          facet === "text"
            ? words.every((word) => entry.textContent.toLowerCase().includes(word))
            : !control.value || values(entry, facet).includes(control.value));
        entry.hidden = !fits;
        shown += fits;
      });
      count.textContent = shown + " of " + entries.length;
    }

    function remember() {
      const wanted = new URLSearchParams();
      Object.entries(controls).forEach(([facet, control]) => control.value && wanted.set(facet, control.value));
      history.replaceState(null, "", wanted.size ? "#" + wanted : location.pathname + location.search);
    }

    function recall() {
      const wanted = new URLSearchParams(location.hash.slice(1));
      Object.entries(controls).forEach(([facet, control]) => { control.value = wanted.get(facet) || ""; });
      apply();
    }

    form.addEventListener("input", () => { apply(); remember(); });
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("reset", () => setTimeout(() => { apply(); remember(); }));
    window.addEventListener("hashchange", recall);
    recall();
  }

  function sortable(table) {
    const body = table.tBodies[0];
    [...table.tHead.rows[0].cells].forEach((head, column) => {
      const button = element("button", { type: "button", class: "sort" }, head.textContent.trim());
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const down = head.getAttribute("aria-sort") === "ascending";
        table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down ? "descending" : "ascending");
        const key = (row) => row.cells[column].textContent.trim();
        const rows = [...body.rows].sort((a, b) => key(a).localeCompare(key(b), undefined, { numeric: true }));
        body.append(...(down ? rows.reverse() : rows));
      });
    });
  }

  document.addEventListener("DOMContentLoaded", () => {
    document.querySelectorAll(".filterable").forEach(filterable);
    document.querySelectorAll(".filterable table").forEach(sortable);
  });
})();
