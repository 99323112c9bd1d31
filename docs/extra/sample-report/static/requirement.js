"use strict";
/* One requirement: limit, value, interval, how the evidence grew, the routes behind it. */
driveRobust.views.set("requirement", (() => {
  const { h, link, shown, shownBeside, shownLimit, between, counted, badge, seconds, fixed, breakable, scroller } = driveRobust;

  function render([agent, sentence], query) {
    const item = driveRobust.requirementsCalled(agent, sentence)[Number(query.get("number") || 0)];
    if (!item) return { title: "No such requirement", nodes: [h("h1", {}, "No such requirement"), h("p", {}, sentence)] };
    const routes = routesOf(item);
    return {
      title: item.requirement,
      nodes: [
        h("p", { class: "crumbs" }, h("a", { href: link([]) }, "Requirements"), " / ", item.agent),
        h("h1", {}, badge(item.verdict), " ", driveRobust.requirementLabel(item)),
        h("p", { class: "lead" }, sentenceOf(item)),
        item.promise ? h("p", { class: "promise" }, item.promise) : null,
        item.reason ? h("p", { class: "notice" }, item.reason) : null,
        broken(item),
        worst(item),
        h("div", { class: routes.some(({ twin }) => twin) ? "columns" : "columns single" },
          item.growth.length ? h("section", {}, h("h2", {}, "How the evidence grew"), driveRobust.charts.growth(item), growthKey(item), growthWords(item)) : null,
          scatter(routes)),
        table(routes),
        h("p", { class: "soft" }, `test ${item.nodeid}`),
      ],
    };
  }

  function sentenceOf(item) {
    if (item.value === null) return "It could not be judged.";
    const interval = between(item.metric, item.low, item.high, item.limit, item.lenient ?? item.limit);
    const routes = item.planned > item.routes ? `${item.routes} of ${counted(item.planned, "route")}` : counted(item.routes, "route");
    const where = item.rule === "evidence" ? " on routes like these" : "";
    return `${item.metric} is ${shownBeside(item.value, item.limit)}${interval ? `, ${item.level} interval${where} ${interval}` : ""}; the limit is ${item.comparison} ${shownLimit(item.metric, item.limit)}. ${routes}${item.rule ? `, rule ${item.rule}` : ""}.`;
  }

  function growthKey(item) {
    const band = item.growth.some((point) => point[2] !== null || point[3] !== null) ? `; pale: its ${item.level} interval` : "";
    return h("p", { class: "soft" }, `Line: ${item.metric} of the routes read so far${band}; shaded: beyond the limit.`);
  }

  function growthWords(item) {
    const points = item.growth;
    return h("details", {}, h("summary", {}, "As a table"), scroller("Evidence", h("table", { class: "list" },
      h("thead", {}, h("tr", {}, ["routes", item.metric, "from", "to"].map((name) => h("th", { scope: "col", class: "number" }, name)))),
      h("tbody", {}, points.map((point) => h("tr", {}, h("th", { scope: "row", class: "number" }, point[0]), point.slice(1).map((value) => h("td", { class: "number" }, shown(value)))))))));
  }

  /* Return the episodes behind the verdict with their twins, in the order of reading. */
  function routesOf(item) {
    const episodes = driveRobust.episodes.own();
    return item.order.flatMap((route) => item.seeds.map((seed) => episodes.find((found) => found.agent === item.agent && found.setting === item.setting && found.route === route && found.seed === seed)))
      .filter(Boolean)
      .map((episode) => ({ episode, twin: twinOf(episode) }));
  }

  function twinOf(episode) {
    return episode.twin >= 0 ? driveRobust.episodes.all()[episode.twin] : null;
  }

  /* An error has no routes behind it: show the broken episodes, those in which the agent or the simulation broke. */
  function broken(item) {
    if (!item.broken.length) return null;
    const all = driveRobust.episodes.all();
    return h("section", {}, h("h2", {}, "Broken episodes"), h("p", { class: "soft" }, "In them the agent or the simulation broke, so the requirement could not be judged."), driveRobust.episodeTable(item.broken.map((number) => all[number])));
  }

  function worst(item) {
    if (!item.worst.length) return null;
    const all = driveRobust.episodes.all();
    /* The driving score, after the value of the metric that ranked the route, if that is another metric. */
    const numbers = (value, ds) => `${value === null ? "" : `${item.metric} ${shown(value)}, `}DS ${fixed(ds, 1)}`;
    return h("section", {}, h("h2", {}, "Worst routes"), h("ul", { class: "cards" }, item.worst.map(([number, cleanValue, value]) => {
      const episode = all[number];
      const twin = twinOf(episode);
      return h("li", {},
        h("a", { href: driveRobust.episodes.href(episode, driveRobust.episodes.moment(episode)) }, breakable(`${episode.place.scenario} ${episode.route}${item.seeds.length > 1 ? `, seed ${episode.seed}` : ""}`), episode.trace ? h("span", { class: "go" }, " watch") : null),
        h("p", {}, twin ? [h("span", { class: "of clean" }, `clean ${numbers(cleanValue, twin.ds)}`), " \u2192 "] : null, h("span", { class: "of perturbed" }, numbers(value, episode.ds))),
        h("p", { class: "soft" }, episode.story, episode.parted !== null ? `; diverged at ${seconds(episode.parted)} ${episode.partedBy}` : ""));
    })));
  }

  function scatter(routes) {
    const pairs = routes.filter(({ twin, episode }) => twin && twin.scored && episode.scored);
    if (!pairs.length) return null;
    return h("section", {}, h("h2", {}, "Clean against perturbed"), driveRobust.charts.scatter(pairs.map(({ episode, twin }) => [twin.ds, episode.ds, driveRobust.episodes.href(episode, driveRobust.episodes.moment(episode)), `${episode.place.scenario} ${episode.route}: ${fixed(twin.ds, 1)} clean, ${fixed(episode.ds, 1)} perturbed`]), "Driving scores of each route, clean across and perturbed up"),
      h("p", { class: "soft" }, "Each point is a route: below the line it lost score. A point opens its replay."));
  }

  function table(routes) {
    if (!routes.length) return null;
    return h("section", {}, h("h2", {}, "Routes in the order of reading"), driveRobust.episodeTable(routes.map(({ episode }) => episode), { clean: routes.some(({ twin }) => twin), numbered: true, agent: false, setting: false }));
  }

  return { render };
})());
