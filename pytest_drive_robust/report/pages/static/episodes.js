"use strict";
/* All episodes: search, filter, sort. Also the table of episodes that other views show. */
driveRobust.episodeTable = (() => {
  const { h, fixed, seconds, breakable, scroller } = driveRobust;
  const STEP = 200;
  const COLUMNS = [
    ["scenario", (item) => item.place.scenario, false], ["route", (item) => item.route, false], ["setting", (item) => item.setting, false],
    ["DS", (item) => item.ds ?? -1, true], ["what happened", (item) => item.story, false], ["driven", (item) => item.seconds, true],
  ];
  const HIDDEN_NARROW = { "clean DS": "twin", driven: "driven" };

  /* Return the episodes with the worst first, and how they were ranked, as verdict/explain.py ranks routes. */
  function ranked(episodes) {
    const all = driveRobust.episodes.all();
    const clean = (item) => (item.twin >= 0 ? all[item.twin].ds : null);
    const relative = episodes.every((item) => clean(item) !== null);
    const lost = (item) => (relative ? clean(item) : 100) - (item.ds ?? 0);
    const words = relative ? "the largest loss of driving score (DS) against clean" : "the lowest driving score (DS)";
    return [[...episodes].sort((one, other) => lost(other) - lost(one)), words];
  }

  return (episodes, { clean = false, numbered = false, worst = false, agent = driveRobust.episodes.agents().length > 1, setting = true } = {}) => {
    const all = driveRobust.episodes.all();
    let [sorted, way, count] = [null, 1, STEP];
    const order = h("p", { class: "soft", hidden: !worst || episodes.length < 2 });
    if (worst) {
      const [items, words] = ranked(episodes);
      episodes = items;
      order.textContent = `The worst first: ${words}`;
    }
    const body = h("tbody", {});
    const more = h("button", { type: "button", onclick: () => { count += STEP; fill(); } });
    const columns = COLUMNS.filter(([name]) => setting || name !== "setting");
    if (agent) columns.splice(2, 0, ["agent", (item) => item.agent, false]);
    if (clean) columns.splice(columns.length - 3, 0, ["clean DS", (item) => (item.twin >= 0 ? all[item.twin].ds ?? -1 : -1), true]);
    const heads = columns.map(([name, of, number]) => h("th", { scope: "col", class: [number ? "number" : "", HIDDEN_NARROW[name] || ""].join(" ").trim() || null }, h("button", { type: "button", class: "sort", onclick: () => sort(name, of) }, name)));

    function sort(name, of) {
      way = sorted === name ? -way : 1;
      sorted = name;
      order.hidden = true;
      const collator = new Intl.Collator("en", { numeric: true });
      episodes = [...episodes].sort((one, other) => {
        const [a, b] = [of(one), of(other)];
        return way * (typeof a === "number" ? a - b : collator.compare(a, b));
      });
      columns.forEach(([found], at) => heads[at].setAttribute("aria-sort", found === name ? (way > 0 ? "ascending" : "descending") : "none"));
      fill();
    }

    function fill() {
      body.replaceChildren(...episodes.slice(0, count).map((item, at) => {
        const href = driveRobust.episodes.href(item, driveRobust.episodes.moment(item));
        const cells = columns.map(([name, of]) => {
          if (name === "scenario") return h("th", { scope: "row" }, h("a", { href }, breakable(item.place.scenario)));
          if (name === "DS") return h("td", { class: `number score${item.scored ? (item.success ? " won" : " lost") : ""}`, "data-label": "DS" }, fixed(item.ds, 1));
          if (name === "clean DS") return h("td", { class: "number twin" }, item.twin >= 0 ? fixed(all[item.twin].ds, 1) : "\u2013");
          if (name === "driven") return h("td", { class: "number driven" }, seconds(item.seconds));
          if (name === "route") return h("td", { class: "route", "data-label": "route" }, item.seed ? `${item.route}, seed ${item.seed}` : item.route);
          return h("td", { class: name === "what happened" ? "story" : name }, of(item));
        });
        return h("tr", {}, numbered ? h("td", { class: "number soft place" }, at + 1) : null, cells);
      }));
      more.hidden = episodes.length <= count;
      more.textContent = `Show more: ${Math.min(count, episodes.length)} of ${episodes.length} are here`;
    }

    fill();
    return [order, scroller("Episodes", h("table", { class: "list episodes" }, h("thead", {}, h("tr", {}, numbered ? h("td", { class: "place" }) : null, heads)), body)), more];
  };
})();

driveRobust.views.set("episodes", (() => {
  const { h, place, counted } = driveRobust;
  const FILTERS = [
    ["agent", (item) => [item.agent]], ["setting", (item) => [item.setting]], ["scenario", (item) => [item.place.scenario]],
    ["ability", (item) => item.place.abilities.map((name) => name.replace("_", " "))], ["weather", (item) => (item.place.weather ? [item.place.weather] : [])],
    ["outcome", (item) => [outcome(item)]], ["kind", (item, run) => (item.cluster >= 0 ? [run.clusters[item.cluster].name] : [])],
  ];

  function outcome(item) {
    if (item.outcome === "infra_error") return "the simulation broke";
    if (item.outcome === "agent_error") return "the agent broke";
    if (item.success) return "success";
    return item.outcome === "completed" ? "completed with infractions" : "did not complete the route";
  }

  function render(parts, query) {
    const run = driveRobust.given.get("run");
    const episodes = driveRobust.episodes.own();
    const results = h("div", {});
    const count = h("p", { class: "lead", role: "status" });
    const search = h("input", { type: "search", value: query.get("q") || "", placeholder: "scenario, route, what happened", "aria-label": "Search", oninput: () => change("q", search.value) });
    const sentence = new Map(run.clusters.map((cluster) => [cluster.name, cluster.sentence]));
    const selects = FILTERS.map(([name, of]) => {
      const words = [...new Set(episodes.flatMap((item) => of(item, run)))].sort();
      const select = h("select", { name, onchange: () => change(name, select.value) }, h("option", { value: "" }, "any"), words.map((word) => h("option", { value: word, selected: query.get(name) === word }, name === "kind" ? sentence.get(word) : word)));
      return words.length > 1 || query.get(name) ? h("label", {}, h("span", {}, name === "kind" ? "what went wrong" : name), select) : null;
    });
    const now = Object.fromEntries(query);

    function change(name, value) {
      now[name] = value;
      driveRobust.keep(now);
      show();
    }

    function show() {
      const words = (now.q || "").toLowerCase().split(/\s+/).filter(Boolean);
      const active = FILTERS.filter(([name]) => now[name]);
      const found = episodes.filter((item) => active.every(([name, of]) => of(item, run).includes(now[name])) && words.every((word) => textOf(item).includes(word)));
      const well = found.filter((item) => item.success).length;
      const chosen = [...words, ...active.map(([name]) => `${name} ${now[name]}`)].join(", ");
      count.replaceChildren(`${found.length} of ${counted(episodes.length, "episode")}: \u2713 ${well} without a fault, \u2717 ${found.length - well} went wrong`, h("span", { class: "printed" }, chosen && `; chosen: ${chosen}`));
      results.replaceChildren(...driveRobust.episodeTable(found, { clean: true, worst: now.order === "worst" }));
    }

    const texts = new Map();
    function textOf(item) {
      if (!texts.has(item)) texts.set(item, [item.place.scenario, item.route, item.place.town, item.place.weather, item.agent, item.setting, item.story, item.end].join(" ").toLowerCase());
      return texts.get(item);
    }

    show();
    return {
      title: "Episodes",
      nodes: [
        h("h1", {}, "Episodes"), count,
        h("form", { class: "filters", role: "search", onsubmit: (event) => event.preventDefault() }, h("label", { class: "wide" }, h("span", {}, "search"), search), selects,
          h("a", { class: "button", href: "#/episodes" }, "Clear")),
        results,
      ],
    };
  }

  return { render };
})());
