"use strict";
/* Shows the view that the address names. */
(() => {
  const { h, place, views, link } = driveRobust;
  const main = document.getElementById("main");
  let shown = null;
  let path = null;
  let turn = 0;

  function tabs() {
    const run = driveRobust.given.get("run");
    const found = [["", "Overview"], ["failures", "What went wrong"], ["episodes", "Episodes"]];
    if (run.comparison) found.push(["compare", "Compare"]);
    return found;
  }

  const TAB_OF = { requirement: "", episode: "episodes" };

  async function show({ first = false } = {}) {
    turn += 1;
    const mine = turn;
    const { parts, query } = place();
    const name = parts[0] || "";
    const view = views.get(name);
    let made;
    try {
      made = view ? await view.render(parts.slice(1), query) : { title: "Not here", nodes: [h("h1", {}, "There is no such view")] };
    } catch (error) {
      made = { title: "Cannot be shown", nodes: [h("h1", {}, "This cannot be shown"), h("p", { class: "notice" }, String(error.message || error))] };
      console.error(error);
    }
    if (mine !== turn) return;
    if (shown && shown.stop) shown.stop();
    shown = made;
    main.replaceChildren(...made.nodes.flat(Infinity).filter(Boolean));
    const run = driveRobust.given.get("run");
    document.title = `${made.title} - ${run.label}`;
    const tab = name in TAB_OF ? TAB_OF[name] : name;
    document.getElementById("nav").replaceChildren(...tabs().map(([part, words]) => h("a", { href: link(part ? [part] : []), "aria-current": part === tab ? "page" : null }, words)));
    if (made.start) made.start();
    const again = String(parts) === path && main.querySelector(`a[href="${CSS.escape(location.hash)}"]`);
    path = String(parts);
    // a choice within the view keeps its place: who works by keyboard goes on from there
    if (again) again.focus({ preventScroll: true });
    else if (!first) { window.scrollTo(0, 0); main.focus({ preventScroll: true }); driveRobust.tell(made.title); }
    document.documentElement.dataset.ready = name || "overview";
  }

  function theme() {
    const button = document.getElementById("theme");
    const root = document.documentElement;
    const dark = () => (root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches);
    const set = (value) => { root.dataset.theme = value; label(); document.dispatchEvent(new Event("drive-robust-theme")); };
    const label = () => { button.textContent = dark() ? "Light" : "Dark"; button.setAttribute("aria-label", `${button.textContent} colours`); };
    try { const kept = localStorage.getItem("drive-robust-theme"); if (kept) root.dataset.theme = kept; } catch { /* a folder on a disk may have no storage */ }
    button.hidden = false;
    label();
    button.addEventListener("click", () => {
      set(dark() ? "light" : "dark");
      try { localStorage.setItem("drive-robust-theme", root.dataset.theme); } catch { /* then it is forgotten */ }
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { label(); document.dispatchEvent(new Event("drive-robust-theme")); });
  }

  /* Paper is light, and all that can be opened is open on it. */
  function printing() {
    const root = document.documentElement;
    let kept;
    let closed = [];
    const change = (value) => {
      if (value) root.dataset.theme = value; else delete root.dataset.theme;
      document.dispatchEvent(new Event("drive-robust-theme"));
    };
    addEventListener("beforeprint", () => {
      kept = root.dataset.theme;
      closed = [...document.querySelectorAll("details:not([open])")];
      closed.forEach((item) => { item.open = true; });
      change("light");
    });
    addEventListener("afterprint", () => { closed.forEach((item) => { item.open = false; }); change(kept); });
  }

  theme();
  printing();
  // the address names the view, so the link to the content must not change the address
  document.querySelector(".skip").addEventListener("click", (event) => { event.preventDefault(); main.focus(); });
  if (!driveRobust.given.has("run")) {
    main.replaceChildren(h("h1", {}, "The data is not there"), h("p", {}, "Unpack the whole folder: data/run.js belongs beside this page."));
    return;
  }
  addEventListener("hashchange", () => show());
  show({ first: true });
})();
