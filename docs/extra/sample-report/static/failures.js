"use strict";
/* Episodes that broke, grouped by what happened. */
driveRobust.views.set("failures", (() => {
  const { h, link, counted, scroller } = driveRobust;

  function render([name]) {
    const run = driveRobust.given.get("run");
    const clusters = run.clusters || [];
    if (name) return one(run, clusters.find((item) => item.name === name));
    const settings = [...new Set(run.rows.map((row) => row.setting))];
    const episodes = driveRobust.episodes.all();
    const total = clusters.reduce((sum, cluster) => sum + cluster.episodes.length, 0);
    if (!total) return { title: "Failures", nodes: [h("h1", {}, "No episode broke"), h("p", {}, "Every route was driven to its end without an infraction.")] };
    const most = Math.max(...clusters.flatMap((cluster) => settings.map((setting) => countOf(episodes, cluster, setting))));
    return {
      title: "Failures",
      nodes: [
        h("h1", {}, `${counted(total, "failure")} of ${clusters.length} kind${clusters.length === 1 ? "" : "s"}`),
        h("p", { class: "lead" }, "Grouped by what went wrong first and what the car was doing then. The columns are settings; a number opens its episodes."),
        scroller("Failures by setting", h("table", { class: "matrix tall" },
          h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "what happened"), h("th", { scope: "col", class: "number" }, "all"), h("th", { scope: "col" }, "example"), settings.map((setting) => h("th", { scope: "col", class: "turned" }, h("span", {}, setting))))),
          h("tbody", {}, clusters.map((cluster) => h("tr", {},
            h("th", { scope: "row" }, h("a", { href: link(["failures", cluster.name]) }, cluster.sentence)),
            h("td", { class: "number" }, cluster.episodes.length),
            h("td", {}, example(episodes[cluster.example])),
            settings.map((setting) => {
              const count = countOf(episodes, cluster, setting);
              return h("td", { class: "number heat low", vars: { share: `${Math.round((80 * count) / most)}%` } }, count ? h("a", { href: link(["episodes"], { kind: cluster.name, setting }), "aria-label": `${count} under ${setting}` }, count) : h("span", { class: "soft" }, "\u00b7"));
            })))))),
      ],
    };
  }

  function countOf(episodes, cluster, setting) {
    return cluster.episodes.filter((number) => episodes[number].setting === setting).length;
  }

  function example(episode) {
    return h("a", { href: driveRobust.episodes.href(episode, driveRobust.episodes.moment(episode)), title: episode.story }, "watch", h("span", { class: "hidden" }, ` ${episode.place.scenario} ${episode.route} under ${episode.setting}`));
  }

  function one(run, cluster) {
    if (!cluster) return { title: "No such failure", nodes: [h("h1", {}, "No such kind of failure")] };
    const episodes = driveRobust.episodes.all();
    return {
      title: cluster.sentence,
      nodes: [
        h("p", { class: "crumbs" }, h("a", { href: link(["failures"]) }, "Failures")),
        h("h1", {}, cluster.sentence),
        h("p", { class: "lead" }, counted(cluster.episodes.length, "episode")),
        driveRobust.episodeTable(cluster.episodes.map((number) => episodes[number]), { clean: true }),
      ],
    };
  }

  return { render };
})());
