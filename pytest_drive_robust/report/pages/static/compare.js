"use strict";
/* The view of two runs: the metrics that got worse, by how much, and the routes that flipped. */
driveRobust.views.set("compare", (() => {
  const { h, fixed, signed, shown, badge, counted, scroller } = driveRobust;
  /* The heading of a conclusion that is not good, by the words that the conclusion begins with. */
  const HEADS = { "NOT COMPARED": "Not compared", "NOT JUDGED": "Not judged", INCONCLUSIVE: "Inconclusive", REGRESSION: "It got worse" };

  function render() {
    const { comparison } = driveRobust.given.get("run");
    if (!comparison) return { title: "Compare", nodes: [h("h1", {}, "Nothing to compare with"), h("p", {}, "Write the report with ", h("code", {}, "--against BASE"), ".")] };
    const worst = [...comparison.settings].sort((one, other) => (one.dsChange ? one.dsChange[0] : 0) - (other.dsChange ? other.dsChange[0] : 0));
    const flips = worst.flatMap((cell) => cell.flips.map((flip) => ({ ...flip, cell })));
    return {
      title: "Compare",
      nodes: [
        h("h1", {}, headline(comparison.conclusion)),
        h("p", { class: "lead" }, comparison.conclusion),
        h("p", { class: "soft" }, `before: ${comparison.before}${comparison.beforeStored ? ` (${comparison.beforeStored})` : ""}; now: ${comparison.after}`),
        comparison.settings.length ? h("section", {}, h("h2", {}, "Settings, the worst change first"), table(worst)) : null,
        means(comparison),
        list("Newly going wrong", flips.filter((flip) => flip.fails)),
        list("Newly without a fault", flips.filter((flip) => !flip.fails)),
        comparison.notes.length ? h("section", {}, h("h2", {}, "To know"), h("ul", {}, comparison.notes.map((note) => h("li", {}, note)))) : null,
      ],
    };
  }

  function headline(conclusion) {
    const word = Object.keys(HEADS).find((begin) => conclusion.startsWith(begin));
    return word ? HEADS[word] : "No regression shown";
  }

  function table(cells) {
    const reach = Math.max(5, ...cells.filter((cell) => cell.dsChange && cell.changed).map((cell) => Math.max(Math.abs(cell.dsChange[1]), Math.abs(cell.dsChange[2]))));
    return scroller("Changes", h("table", { class: "list" },
      h("thead", {}, h("tr", {}, ["verdict", "setting", "agent", "DS before", "now", "change of DS", "", "SR", "RD", "routes changed"].map((name) => h("th", { scope: "col", class: /DS|now|SR|RD|routes/.test(name) ? "number" : null }, name || h("span", { class: "hidden" }, "change, drawn"))))),
      h("tbody", {}, cells.map((cell) => h("tr", {},
        h("td", {}, badge(cell.verdict)), h("th", { scope: "row" }, cell.setting), h("td", {}, cell.agent),
        h("td", { class: "number" }, fixed(cell.before.ds, 1)), h("td", { class: "number" }, fixed(cell.after.ds, 1)),
        h("td", { class: "number" }, cell.dsChange && cell.changed ? [signed(cell.dsChange[0], 1), h("span", { class: "range" }, ` ${signed(cell.dsChange[1], 1)} to ${signed(cell.dsChange[2], 1)}`)] : "\u2013"),
        h("td", {}, cell.dsChange && cell.changed ? driveRobust.charts.change(cell.dsChange, reach, `DS changed by ${signed(cell.dsChange[0], 1)}, ${signed(cell.dsChange[1], 1)} to ${signed(cell.dsChange[2], 1)}`) : ""),
        h("td", { class: "number" }, `${shown(cell.before.sr)} \u2192 ${shown(cell.after.sr)}`),
        h("td", { class: "number" }, cell.rise ? [`${shown(cell.rise.before)} \u2192 ${shown(cell.rise.after)}`, h("span", { class: "range" }, cell.changed ? ` ${signed(cell.rise.low, 2)} to ${signed(cell.rise.high, 2)}` : "")] : "\u2013"),
        h("td", { class: "number" }, `${cell.changed} of ${cell.routes}`))))));
  }

  function means(comparison) {
    const lines = Object.entries(comparison.means);
    return lines.length ? h("ul", {}, lines.map(([agent, rise]) => h("li", {}, `${agent}: mean RD ${shown(rise.before)} \u2192 ${shown(rise.after)}, by ${signed(rise.low, 3)} to ${signed(rise.high, 3)} on ${counted(rise.routes, "route")}`))) : null;
  }

  function list(title, flips) {
    if (!flips.length) return null;
    return h("section", {}, h("h2", {}, `${title}: ${counted(flips.length, "route")}`), scroller(title, h("table", { class: "list" },
      h("thead", {}, h("tr", {}, ["route", "setting", "before", "now"].map((name) => h("th", { scope: "col" }, name)))),
      h("tbody", {}, flips.map((flip) => {
        const { episodes } = driveRobust;
        const before = episodes.find(1, flip.cell.agentBefore, flip.cell.setting, flip.route, flip.before.seed);
        const now = episodes.find(0, flip.cell.agent, flip.cell.setting, flip.route, flip.after.seed);
        const name = `${flip.scenario} ${flip.route}`;
        const score = (item, episode) => [h("strong", {}, `DS ${fixed(item.ds, 1)}`), " ", h("span", { class: "soft" }, episode ? episode.story : item.story)];
        return h("tr", {}, h("th", { scope: "row" }, now ? h("a", { href: episodes.href(now, momentOf(now, flip), { with: "before" }) }, name) : name), h("td", {}, flip.cell.setting), h("td", {}, score(flip.before, before)), h("td", {}, score(flip.after, now)));
      })))));
  }

  function momentOf(now, flip) {
    const before = driveRobust.episodes.counterpart(now);
    return driveRobust.episodes.moment(flip.fails || !before ? now : before);
  }

  return { render };
})());
