"use strict";
/* Episodes that went wrong, grouped by what happened. */
driveRobust.views.set("failures", (() => {
  const { h, link, counted, scroller } = driveRobust;

  function render([name]) {
    const run = driveRobust.given.get("run");
    const { clusters } = run;
    if (name) return one(run, clusters.find((item) => item.name === name));
    const total = clusters.reduce((sum, cluster) => sum + cluster.episodes.length, 0);
    if (!total) return { title: "What went wrong", nodes: [h("h1", {}, "No episode went wrong"), h("p", {}, "Every route was driven to its end without an infraction.")] };
    return {
      title: "What went wrong",
      nodes: [
        h("h1", {}, `${counted(total, "episode")} went wrong, in ${counted(clusters.length, "way")}`),
        h("p", { class: "lead" }, "Grouped by what went wrong first and what the car was doing then. The columns are settings, shaded by the share of their episodes; a number opens its episodes."),
        matrix(run, clusters),
      ],
    };
  }

  function matrix(run, clusters) {
    const episodes = driveRobust.episodes.all();
    const columns = columnsOf(run);
    const agents = [...new Set(columns.map((column) => column.agent))];
    const most = Math.max(...clusters.flatMap((cluster) => columns.map((column) => countOf(episodes, cluster, column) / column.driven)));
    const sum = (of) => columns.reduce((total, column) => total + of(column), 0);
    const spans = agents.map((agent) => [agent, columns.filter((column) => column.agent === agent).length]).filter(([, count]) => count);
    return scroller("What went wrong, by setting", h("table", { class: "matrix tall" },
      h("thead", {},
        agents.length > 1 ? h("tr", {}, h("td", { colspan: 3 }), spans.map(([agent, count]) => h("th", { scope: "colgroup", colspan: count, class: "group", title: agent }, agent))) : null,
        h("tr", {}, h("th", { scope: "col" }, "what happened"), h("th", { scope: "col", class: "number" }, "all"), h("th", { scope: "col" }, "example"), columns.map(({ setting }) => h("th", { scope: "col", class: "turned", title: setting }, h("span", {}, setting))))),
      h("tbody", {},
        h("tr", { class: "driven" }, h("th", { scope: "row" }, "went wrong, of driven"), share(sum((column) => column.wrong), sum((column) => column.driven)), h("td", {}), columns.map((column) => share(column.wrong, column.driven))),
        clusters.map((cluster) => h("tr", {},
          h("th", { scope: "row" }, h("a", { href: link(["failures", cluster.name]) }, cluster.sentence)),
          h("td", { class: "number" }, cluster.episodes.length),
          h("td", {}, example(episodes[cluster.example], agents.length > 1)),
          columns.map((column) => cell(cluster, column, countOf(episodes, cluster, column), most)))))));
  }

  /* Settings differ in their numbers of episodes, because a verdict may stop early: a count alone would mislead. */
  function columnsOf(run) {
    const own = driveRobust.episodes.own();
    const names = new Map(run.rows.map((row) => [JSON.stringify([row.agent, row.setting]), row]));
    return [...names.values()].map(({ agent, setting }) => {
      const driven = own.filter((episode) => episode.agent === agent && episode.setting === setting);
      return { agent, setting, driven: driven.length, wrong: driven.filter((episode) => episode.cluster >= 0).length };
    }).filter((column) => column.driven);
  }

  function share(wrong, driven) {
    return h("td", { class: "number" }, wrong, h("span", { class: "range" }, ` of ${driven}`));
  }

  function cell(cluster, { agent, setting, driven }, count, most) {
    const words = `${count} of ${counted(driven, "episode")} of ${agent} under ${setting}`;
    return h("td", { class: "number heat low", title: words, vars: { share: `${Math.round((80 * count) / driven / most)}%` } },
      count ? h("a", { href: link(["episodes"], { kind: cluster.name, agent, setting }), "aria-label": words }, count) : h("span", { class: "soft" }, "\u00b7"));
  }

  function countOf(episodes, cluster, { agent, setting }) {
    return cluster.episodes.filter((number) => episodes[number].agent === agent && episodes[number].setting === setting).length;
  }

  function example(episode, several) {
    return h("a", { href: driveRobust.episodes.href(episode, driveRobust.episodes.moment(episode)), title: episode.story }, "watch", several ? h("span", { class: "soft" }, ` ${episode.agent}`) : null, h("span", { class: "hidden" }, ` ${episode.place.scenario} ${episode.route} under ${episode.setting}`));
  }

  function one(run, cluster) {
    if (!cluster) return { title: "Nothing like this", nodes: [h("h1", {}, "No episode went wrong in this way")] };
    const episodes = driveRobust.episodes.all();
    return {
      title: cluster.sentence,
      nodes: [
        h("p", { class: "crumbs" }, h("a", { href: link(["failures"]) }, "What went wrong")),
        h("h1", {}, cluster.sentence),
        h("p", { class: "lead" }, counted(cluster.episodes.length, "episode")),
        driveRobust.episodeTable(cluster.episodes.map((number) => episodes[number]), { clean: true }),
      ],
    };
  }

  return { render };
})());
