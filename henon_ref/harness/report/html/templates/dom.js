// Elements. Text is always text, never markup: nothing here reads HTML.

const SVG = "http://www.w3.org/2000/svg";

/** An HTML element with attributes, listeners ("onclick") and children; missing attributes and children are left out. */
function make(name, attributes, ...children) {
  return filled(document.createElement(name), attributes, children);
}

/** The same for SVG. */
function shape(name, attributes, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

function filled(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== ""));
  return node;
}

const byId = (id) => document.getElementById(id);

/** A table from headings and rows; a heading is text, or [text, "number"] for a column of numbers. */
function table(headings, rows, caption) {
  const columns = headings.map((own) => (Array.isArray(own) ? own : [own, null]));
  const head = columns.map(([text, side]) => make("th", { scope: "col", class: side }, text));
  const body = rows.map((cells) =>
    make("tr", { class: cells.now ? "now" : null }, cells.map((cell, k) =>
      k === 0 ? make("th", { scope: "row" }, cell) : make("td", { class: columns[k][1], "data-label": columns[k][0] }, cell))));
  return make("table", null, caption ? make("caption", null, caption) : null,
    make("thead", null, make("tr", null, head)), make("tbody", null, body));
}

/** A select's options: [value, text] each, or a text that is both. */
function options(select, entries) {
  select.replaceChildren(...entries.map((own) => {
    const [value, text] = Array.isArray(own) ? own : [own, own];
    return make("option", { value }, text);
  }));
}

/** One tab stop for many links or points; arrow keys move between them, by rows and columns where there are any. */
function arrowKeys(container, selector) {
  container.addEventListener("keydown", (event) => {
    const from = event.target.closest(selector);
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
    const step = steps[event.key];
    if (!from || !step) return;
    const row = from.closest("tr");
    let next = null;
    if (row) {
      const visible = (own) => [...own.querySelectorAll(selector)].filter((one) => one.getClientRects().length > 0);
      const column = visible(row).indexOf(from);
      const rows = [...row.parentElement.children].filter((own) => !own.hidden);
      const other = rows[rows.indexOf(row) + step[0]];
      next = other ? visible(other)[column + step[1]] : null;
    } else {
      const all = [...container.querySelectorAll(selector)];
      next = all[all.indexOf(from) + step[0] + step[1]];
    }
    if (!next) return;
    event.preventDefault();
    from.setAttribute("tabindex", "-1");
    next.setAttribute("tabindex", "0");
    next.focus();
  });
}

/** Small text beside what the pointer or the keyboard is on. */
const tooltip = {
  box: null,
  show(text, place) {
    if (!this.box) document.body.append((this.box = make("div", { class: "tooltip", role: "tooltip" })));
    this.box.textContent = text;
    this.box.hidden = false;
    const own = this.box.getBoundingClientRect();
    const left = Math.min(place.right + 8, window.innerWidth - own.width - 8);
    const above = place.top - own.height - 6;
    this.box.style.left = `${Math.max(left, 4)}px`;
    this.box.style.top = `${above > 4 ? above : place.bottom + 6}px`;
  },
  hide() {
    if (this.box) this.box.hidden = true;
  },
  /** Show a text while the pointer is on a node, or the node has the focus. */
  on(node, text) {
    const show = () => this.show(text, node.getBoundingClientRect());
    for (const event of ["pointerenter", "focus"]) node.addEventListener(event, show);
    for (const event of ["pointerleave", "blur"]) node.addEventListener(event, () => this.hide());
  },
};
document.addEventListener("keydown", (event) => event.key === "Escape" && tooltip.hide());

/** The button that makes a page dark or light, whatever the system says; remembered where the browser allows it. */
function themeButton(button) {
  const root = document.documentElement;
  const dark = () => root.dataset.theme === "dark" ||
    (!root.dataset.theme && matchMedia("(prefers-color-scheme: dark)").matches);
  const say = () => { button.textContent = dark() ? "Light page" : "Dark page"; };
  try {
    const kept = localStorage.getItem("henon_ref theme");
    if (kept) root.dataset.theme = kept;
  } catch { /* a page from disk may have no storage */ }
  say();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", say);
  button.addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    say();
    try {
      localStorage.setItem("henon_ref theme", root.dataset.theme);
    } catch { /* then it holds until the page is left */ }
    document.dispatchEvent(new Event("themechange"));
  });
}
