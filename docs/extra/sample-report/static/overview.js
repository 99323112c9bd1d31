"use strict";
/* The first view: requirements that hold or are broken, each agent under each setting, and the options of the run. */
/* Several tests may judge one sentence for an agent, on other routes or seeds: the link counts them. */
driveRobust.requirementsCalled = (agent, sentence) => driveRobust.given.get("run").requirements.filter((item) => item.agent === agent && item.requirement === sentence);
driveRobust.requirementLink = (item) => driveRobust.link(["requirement", item.agent, item.requirement], { number: driveRobust.requirementsCalled(item.agent, item.requirement).indexOf(item) || "" });
driveRobust.requirementLabel = (item) => {
  const twins = driveRobust.requirementsCalled(item.agent, item.requirement);
  const differ = (of) => new Set(twins.map((twin) => String(of(twin)))).size > 1;
  const words = (twin) => [twin.requirement, differ((other) => other.routesSpec) ? ` on ${twin.routesSpec}` : "", differ((other) => other.seeds) ? `, seeds ${twin.seeds.join(", ")}` : ""].join("");
  const test = item.nodeid.split("[")[0].split("::").pop();
  return words(item) + (twins.filter((twin) => words(twin) === words(item)).length > 1 ? `, in ${test}` : "");
};
driveRobust.verdictOrder = ["fail", "error", "inconclusive", "pass"];

driveRobust.views.set("", (() => {
  const { h, link, fixed, shown, shownBeside, between, duration, counted, breakable, badge, scroller } = driveRobust;
  const ALL = ["DS", "SR", "RD", "comfort", "efficiency"];

  function render(parts, query) {
    const run = driveRobust.given.get("run");
    const items = [...run.requirements].sort((one, other) => driveRobust.verdictOrder.indexOf(one.verdict) - driveRobust.verdictOrder.indexOf(other.verdict));
    return {
      title: "Overview",
      nodes: [
        h("h1", {}, headline(run)),
        h("p", { class: "lead" }, what(run)),
        run.comparison ? h("p", { class: `callout ${run.comparison.regressed || run.comparison.refused ? "bad" : "good"}` }, h("a", { href: link(["compare"]) }, run.comparison.conclusion)) : null,
        items.length ? h("section", {}, h("h2", {}, "Requirements"), requirements(items)) : null,
        h("section", { id: "matrix" }, matrix(run, query.get("metric") || (agentsOf(run).length > 1 ? "RD" : "all"))),
        wrong(run),
        notes(run),
        facts(run),
      ],
    };
  }

  function headline(run) {
    const total = run.requirements.length;
    const count = (verdict) => run.requirements.filter((item) => item.verdict === verdict).length;
    if (!total) return run.rows.length ? "Nothing was judged" : "Nothing was driven";
    const parts = [count("pass") === total ? (total === 1 ? "The requirement holds" : `All ${total} requirements hold`) : `${count("pass")} of ${counted(total, "requirement")} ${total === 1 ? "holds" : "hold"}`];
    if (count("fail")) parts.push(`${count("fail")} broken`);
    if (count("error")) parts.push(counted(count("error"), "error"));
    if (count("inconclusive")) parts.push(`${count("inconclusive")} inconclusive`);
    if (run.endedEarly) parts.push("but not all tests came to their verdicts");
    else if (run.stopped) parts.push(`but ${counted(run.stopped, "test")} stopped before the end`);
    else if (run.rows.some((row) => row.finished < row.needed)) parts.push("but not all episodes were driven");
    else if (run.ownVerdicts) parts.push(`but ${counted(run.ownVerdicts, "test")} failed for another reason`);
    return parts.join(", ");
  }

  function agentsOf(run) {
    return [...new Set(run.rows.map((row) => row.agent))];
  }

  function what(run) {
    const episodes = driveRobust.episodes.own();
    const driven = episodes.reduce((sum, item) => sum + item.seconds, 0);
    const wall = episodes.reduce((sum, item) => sum + item.wall, 0);
    const settings = new Set(run.rows.map((row) => row.setting)).size;
    const agents = agentsOf(run);
    const who = agents.length === 1 ? agents[0] : counted(agents.length, "agent");
    return `${who} on ${counted(new Set(episodes.map((item) => item.route)).size, "route")} under ${counted(settings, "setting")}: ${counted(episodes.length, "episode")}, ${duration(driven)} of driving in ${duration(wall)} of computing.`;
  }

  function requirements(items) {
    const extents = new Map(items.map((item) => [item.metric, driveRobust.charts.shared(items, item.metric)]));
    const firsts = new Set([...extents.keys()].map((metric) => items.find((item) => item.metric === metric && item.value !== null)));
    return [scroller("Requirements", h("table", { class: "list requirements" },
      h("thead", {}, h("tr", {}, ["verdict", "requirement", "agent", "value", "against the limit", "routes"].map((name) => h("th", { scope: "col", class: name === "value" || name === "routes" ? "number" : null }, name)))),
      h("tbody", {}, items.map((item) => h("tr", {},
        h("td", {}, badge(item.verdict)),
        h("th", { scope: "row" }, h("a", { href: driveRobust.requirementLink(item) }, driveRobust.requirementLabel(item)), item.verdict === "error" && item.reason ? h("p", { class: "soft why" }, item.reason) : null),
        h("td", { class: "who" }, item.agent),
        h("td", { class: "number" }, shownBeside(item.value, item.limit)),
        h("td", { class: "drawn" }, driveRobust.charts.bullet(item, extents.get(item.metric), firsts.has(item))),
        h("td", { class: "number" }, item.planned > item.routes ? `${item.routes} of ${item.planned}` : item.routes || "\u2013")))))), legendOf(items)];
  }

  /* Return what the bars show: intervals by evidence have another level than intervals by the other rules. */
  function legendOf(items) {
    const levels = new Map(items.filter((item) => item.value !== null).map((item) => [item.rule === "evidence", item.level]));
    const words = [...levels].map(([evidence, level]) => `${level} interval${evidence ? " on routes like these (rule evidence)" : levels.size > 1 ? " (rules list and point)" : ""}`);
    const margin = items.some((item) => item.value !== null && item.lenient !== null) ? ", more strongly beyond its margin: a pass stays out of the stronger shade, a fail lies in either" : "";
    return words.length ? h("p", { class: "legend" }, `Bar: ${words.join(", ")}; line: the limit, shaded beyond it${margin}; each metric has one scale.`) : null;
  }

  /* Return 0 (bad) to 1 (good) for a value, null for a metric without its own scale. */
  function goodness(metric, value) {
    if (value === null || value === undefined) return null;
    const scale = { DS: [0, 100], SR: [0, 1], RD: [0.6, 0], comfort: [0, 100], efficiency: [0, 100] }[metric];
    return scale ? Math.min(Math.max((value - scale[0]) / (scale[1] - scale[0]), 0), 1) : null;
  }

  function cell(row, metric) {
    if (!row) return h("td", { class: "number soft" }, "\u2013");
    const value = row.numbers[metric];
    const share = goodness(metric, value);
    const interval = row.intervals[metric];
    const words = [`${row.agent} under ${row.label}: ${metric} ${shown(value)}`];
    if (interval) words.push(`${driveRobust.given.get("run").level} interval on routes like these ${between(metric, ...interval)}`);
    words.push(`${row.routes} of ${counted(row.planned, "route")}`);
    const empty = value === null || value === undefined;
    const inside = [shown(value), interval ? h("span", { class: "range" }, ` ${rangeOf(metric, interval)}`) : null];
    return h("td", { class: `number heat${share === null ? " flat" : share < 0.5 ? " low" : ""}`, title: words.join(", "), vars: share === null ? {} : { share: `${Math.round(Math.abs(share - 0.5) * 200)}%` } },
      empty ? inside : h("a", { href: link(["episodes"], { agent: row.agent, setting: row.setting, order: "worst" }) }, inside));
  }

  /* As in the terminal, the interval of a driving score has no decimals. */
  function rangeOf(metric, interval) {
    return metric === "DS" ? interval.map((end) => fixed(end, 0)).join(" to ") : between(metric, ...interval);
  }

  function matrix(run, metric) {
    const agents = agentsOf(run);
    const labels = [...new Set(run.rows.map((row) => row.label))];
    const names = ["all", ...ALL];
    const choice = h("div", { class: "choice", role: "group", "aria-label": "Metric" }, names.map((name) => h("a", { href: link([], { metric: name }), class: name === metric ? "here" : null, "aria-current": name === metric ? "true" : null }, name === "all" ? "all metrics" : name)));
    const of = (agent, label) => run.rows.find((row) => row.agent === agent && row.label === label);
    const head = [h("div", { class: "head" }, h("h2", {}, "Agents and settings"), choice)];
    const partial = run.rows.some((row) => row.intervals.DS);
    const figures = partial ? `In small figures, where verdicts did not need all routes: ${run.level} intervals on routes like these.` : "";
    const legend = h("p", { class: "legend scale" }, h("span", { class: "heat low", vars: { share: "80%" } }, "worse"), h("span", { class: "heat", vars: { share: "80%" } }, "better"), metric !== "all" && run.metrics[metric] ? h("span", {}, meaningOf(run, metric)) : null, figures ? h("span", {}, figures) : null);
    if (metric === "all") {
      const several = agents.length > 1;
      return [head, scroller("Agents and settings", h("table", { class: "matrix" },
        h("thead", {}, h("tr", {}, several ? h("th", { scope: "col" }, "agent") : null, h("th", { scope: "col" }, "setting"), ALL.map((name) => h("th", { scope: "col", class: "number" }, name)), h("th", { scope: "col", class: "number" }, "routes"), h("th", { scope: "col" }, "verdict"))),
        h("tbody", {}, run.rows.map((row) => h("tr", {}, several ? h("td", {}, row.agent) : null, h("th", { scope: "row" }, row.label, row.privileged ? h("span", { class: "soft", title: "this agent sees ground truth" }, " *") : null), ALL.map((name) => cell(row, name)),
          h("td", { class: "number" }, routesOf(row)), h("td", {}, badge(row.verdict))))))), legend,
      h("ul", { class: "legend" }, ALL.map((name) => h("li", {}, h("strong", {}, name), ` ${meaningOf(run, name)}`)))];
    }
    return [head, scroller("Agents and settings", h("table", { class: "matrix" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "setting"), agents.map((agent) => h("th", { scope: "col", class: "number" }, agent)))),
      h("tbody", {}, labels.map((label) => h("tr", {}, h("th", { scope: "row" }, label), agents.map((agent) => cell(of(agent, label), metric))))))), legend];
  }

  function meaningOf(run, name) {
    const { meaning, unit } = run.metrics[name];
    return unit ? `${meaning} [${unit}]` : meaning;
  }

  function routesOf(row) {
    if (row.finished < row.needed) return `${row.finished} of ${counted(row.needed, "episode")}`;
    return row.routes < row.planned ? `${row.routes} of ${row.planned}` : String(row.routes);
  }

  function wrong(run) {
    const clusters = run.clusters.slice(0, 5);
    if (!clusters.length) return null;
    const total = driveRobust.episodes.own().filter((item) => item.cluster >= 0).length;
    const most = clusters[0].episodes.length;
    return h("section", {}, h("h2", {}, "What goes wrong most"),
      h("ul", { class: "bars" }, clusters.map((cluster, number) => h("li", {}, h("a", { href: link(["failures", cluster.name]) }, cluster.sentence), h("span", { class: "barline", vars: { share: `${(100 * cluster.episodes.length) / most}%` } }), h("span", { class: "number" }, cluster.episodes.length)))),
      h("p", {}, h("a", { href: link(["failures"]) }, `${counted(total, "episode")} went wrong, in ${counted(run.clusters.length, "way")}`)));
  }

  function notes(run) {
    const lines = [...run.searches, ...run.notes];
    return lines.length ? h("section", {}, h("h2", {}, "To know"), h("ul", {}, lines.map((line) => h("li", {}, line)))) : null;
  }

  function facts(run) {
    const options = run.options;
    const rows = [
      ["run", [run.label, run.stored].filter(Boolean).join(", ")],
      ["simulator", options.simulator], ["routes", options.routes], ["seeds", options.seeds.join(", ")],
      ["reading", options.reading ?? "paper"], ["metrics", options.metrics], ["verdicts", `${options.verdict}, margin ${options.margin}, alpha ${options.alpha}${options.correction === "none" ? "" : `, ${options.correction}`}`],
      ["stopped when standing", options.stuck_stop_s ? `${options.stuck_stop_s} s` : "no"],
      ...Object.entries(run.agents).map(([name, item]) => [name, [item.distribution, item.source && `code ${item.source}`, item.weights && `weights ${item.weights}`].filter(Boolean).join(", ")]),
      ...Object.entries(run.versions),
    ];
    return h("section", {}, h("h2", {}, "What ran"), h("dl", { class: "facts" }, rows.filter(([, value]) => value !== "").map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, breakable(String(value)))))));
  }

  return { render };
})());
