// The search page. Order of results: Sphinx's own scores, the documentation's pages before the reports.
var Scorer = {
  score: ([page, , , , score]) => (page.startsWith("docs/") ? score + 20 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};

// Excerpts: Sphinx fetches each page found, which browsers refuse to a site that is opened from disk. There, the same
// answers come from a file that the build writes beside this one.
if (location.protocol === "file:") {
  const pages = new Promise((resolve) => {
    window.setPageTexts = resolve;
    const script = document.createElement("script");
    script.src = new URL("page_texts.js", document.currentScript.src);
    document.head.appendChild(script);
  });
  const top = new URL("..", document.currentScript.src).href;
  window.fetch = (address) =>
    pages.then((texts) => {
      const path = new URL(address, location.href).href.split("#")[0].slice(top.length);
      const main = document.createElement("div");
      main.setAttribute("role", "main");
      main.textContent = texts[decodeURIComponent(path)] || "";
      return new Response(main.outerHTML);
    });
}
