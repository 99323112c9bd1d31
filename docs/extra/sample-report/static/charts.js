"use strict";
/* Small plots as SVG: an interval against a limit, evidence route by route, clean against perturbed. */
driveRobust.charts = (() => {
  const { h, fixed, shown, shownBeside, shownLimit, between, counted } = driveRobust;

  /* Return [low, high] of an axis that shows all values, with some room. Ends of RD are multiples of a half. */
  function extent(values, metric) {
    const known = values.filter((value) => value !== null && value !== undefined && Number.isFinite(value));
    let [low, high] = [Math.min(...known), Math.max(...known)];
    if (metric === "DS" || metric === "comfort") [low, high] = [0, 100];
    if (metric === "SR") [low, high] = [0, 1];
    if (metric === "RD") [low, high] = [Math.max(Math.floor(2 * Math.min(low, 0)) / 2, -1), 1];
    if (high - low < 1e-9) { low -= 1; high += 1; }
    return [low, high];
  }

  function ticks(low, high, count) {
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 2.5, 5, 10].map((factor) => factor * power).find((value) => value >= rough);
    const found = [];
    for (let value = Math.ceil(low / step) * step; value <= high + 1e-9; value += step) found.push(Math.abs(value) < 1e-9 ? 0 : value);
    return found;
  }

  /* Return [low, high] of the axis that all bullets of a metric share, so that equal limits stand at equal places. */
  function shared(items, metric) {
    return extent(items.filter((item) => item.metric === metric).flatMap((item) => [item.value, item.low, item.high, item.limit]), metric);
  }

  /* Draw an interval, its value and the limit on a line from `low` to `high`; `ends` also writes these two. */
  function bullet(item, [low, high], ends) {
    if (item.value === null) return h("span", { class: "soft" }, "\u2013");
    const [width, height] = [200, ends ? 32 : 22];
    const x = (value) => 4 + ((Math.min(Math.max(value, low), high) - low) / (high - low)) * (width - 8);
    const words = `${item.metric} ${shownBeside(item.value, item.limit)}, ${item.level} interval ${between(item.metric, item.low, item.high, item.limit, item.lenient ?? item.limit)}, limit ${item.comparison} ${shownLimit(item.metric, item.limit)}`;
    const [from, to] = [item.low === null ? low : item.low, item.high === null ? high : item.high];
    const beyond = (value) => h("rect", { class: "forbidden", x: item.comparison === "<=" ? x(value) : 4, y: 7, width: item.comparison === "<=" ? width - 4 - x(value) : x(value) - 4, height: 8 });
    return h("svg", { class: `bullet ${item.verdict}`, viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": words },
      h("title", {}, words),
      beyond(item.limit),
      item.lenient === null ? null : beyond(item.lenient),
      h("line", { class: "axis", x1: 4, x2: width - 4, y1: 11, y2: 11 }),
      h("line", { class: "interval", x1: x(from), x2: x(to), y1: 11, y2: 11 }),
      h("line", { class: "limit", x1: x(item.limit), x2: x(item.limit), y1: 3, y2: 19 }),
      h("circle", { class: "value", cx: x(item.value), cy: 11, r: 4.5 }),
      ends ? [h("text", { class: "end", x: 4, y: 30 }, endOf(low)), h("text", { class: "end", x: width - 4, y: 30, "text-anchor": "end" }, endOf(high))] : null);
  }

  function endOf(value) {
    return fixed(value, Number.isInteger(value) ? 0 : Number.isInteger(2 * value) ? 1 : 2);
  }

  /* Draw how the value and its interval changed with every route that was read. */
  function growth(item) {
    const [width, height, margin] = [640, 300, { left: 84, right: 118, top: 14, bottom: 44 }];
    const points = item.growth.filter((point) => point[1] !== null);
    if (!points.length) return null;
    const all = points.flatMap((point) => point.slice(1)).concat([item.limit, item.lenient]);
    const [low, high] = extent(all, item.metric);
    const last = points[points.length - 1][0];
    const x = (count) => margin.left + (last > 1 ? (count - 1) / (last - 1) : 0.5) * (width - margin.left - margin.right);
    const y = (value) => margin.top + (1 - (Math.min(Math.max(value, low), high) - low) / (high - low)) * (height - margin.top - margin.bottom);
    const label = `${item.metric} after each of ${counted(item.routes, "route")}, against the limit ${shownLimit(item.metric, item.limit)}`;
    const svg = h("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
    const lines = ticks(low, high, 5);
    const decimals = lines.every(Number.isInteger) && high > 1 ? 0 : 2;
    for (const value of lines) {
      svg.append(h("line", { class: "grid", x1: margin.left, x2: width - margin.right, y1: y(value), y2: y(value) }),
        h("text", { class: "tick", x: margin.left - 8, y: y(value) + 4, "text-anchor": "end" }, fixed(value, decimals)));
    }
    for (const count of (last > 1 ? ticks(1, last, 8) : [1]).map(Math.round).filter((value, at, list) => value >= 1 && list.indexOf(value) === at)) {
      svg.append(h("text", { class: "tick", x: x(count), y: height - margin.bottom + 18, "text-anchor": "middle" }, count));
    }
    svg.append(h("text", { class: "label", x: (margin.left + width - margin.right) / 2, y: height - 6, "text-anchor": "middle" }, "routes read"),
      h("text", { class: "label", transform: `translate(19 ${(margin.top + height - margin.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, item.metric));
    const [top, bottom] = item.comparison === "<=" ? [margin.top, y(item.limit)] : [y(item.limit), height - margin.bottom];
    svg.append(h("rect", { class: "forbidden", x: margin.left, y: top, width: width - margin.left - margin.right, height: Math.max(0, bottom - top) }));
    const bounded = points.filter((point) => point[2] !== null || point[3] !== null);
    if (bounded.length > 1) {
      const upper = bounded.map((point) => `${x(point[0])},${y(point[3] === null ? high : point[3])}`);
      const lower = bounded.map((point) => `${x(point[0])},${y(point[2] === null ? low : point[2])}`).reverse();
      svg.append(h("polygon", { class: "band", points: [...upper, ...lower].join(" ") }));
    }
    svg.append(h("line", { class: "limit", x1: margin.left, x2: width - margin.right, y1: y(item.limit), y2: y(item.limit) }));
    const shownLenient = item.lenient !== null && item.lenient >= low && item.lenient <= high;
    if (shownLenient) {
      svg.append(h("line", { class: "lenient", x1: margin.left, x2: width - margin.right, y1: y(item.lenient), y2: y(item.lenient) }));
    }
    svg.append(h("polyline", { class: "curve", points: points.map((point) => `${x(point[0])},${y(point[1])}`).join(" ") }));
    for (const point of points) {
      svg.append(h("circle", { class: "point", cx: x(point[0]), cy: y(point[1]), r: points.length > 60 ? 2 : 3.5 },
        h("title", {}, `after ${counted(point[0], "route")}: ${shown(point[1])}${point[2] === null && point[3] === null ? "" : `, ${between(item.metric, point[2], point[3])}`}`)));
    }
    // beside the plot, where no curve crosses the words, and a line of words apart
    const note = (at, words, strong) => svg.append(h("text", { class: `note${strong ? " strong" : ""}`, x: width - margin.right + 6, y: at + 4 }, words));
    note(y(item.limit), `limit ${shownLimit(item.metric, item.limit)}`, true);
    if (shownLenient) note(item.comparison === "<=" ? Math.min(y(item.lenient), y(item.limit) - 20) : Math.max(y(item.lenient), y(item.limit) + 20), "with margin");
    return svg;
  }

  /* Draw perturbed scores over clean scores; each point is a link. `pairs` are [clean, perturbed, link, words]. */
  function scatter(pairs, label) {
    const [width, height, margin] = [400, 400, { left: 58, right: 24, top: 14, bottom: 46 }];
    const x = (value) => margin.left + (value / 100) * (width - margin.left - margin.right);
    const y = (value) => margin.top + (1 - value / 100) * (height - margin.top - margin.bottom);
    const svg = h("svg", { class: "chart square", viewBox: `0 0 ${width} ${height}`, role: "group", "aria-label": label });
    for (const value of [0, 25, 50, 75, 100]) {
      svg.append(h("line", { class: "grid", x1: x(value), x2: x(value), y1: y(0), y2: y(100) }), h("line", { class: "grid", x1: x(0), x2: x(100), y1: y(value), y2: y(value) }),
        h("text", { class: "tick", x: x(value), y: height - margin.bottom + 18, "text-anchor": "middle" }, value),
        h("text", { class: "tick", x: margin.left - 8, y: y(value) + 4, "text-anchor": "end" }, value));
    }
    svg.append(h("line", { class: "diagonal", x1: x(0), y1: y(0), x2: x(100), y2: y(100) }),
      h("text", { class: "label", x: (x(0) + x(100)) / 2, y: height - 6, "text-anchor": "middle" }, "clean driving score"),
      h("text", { class: "label", transform: `translate(19 ${(y(0) + y(100)) / 2}) rotate(-90)`, "text-anchor": "middle" }, "perturbed driving score"));
    const seen = new Map();
    for (const [clean, perturbed, href, words] of pairs) {
      const spot = `${Math.round(clean / 3)} ${Math.round(perturbed / 3)}`;
      const again = seen.get(spot) || 0;
      seen.set(spot, again + 1);
      // points that would lie on each other stand in a small spiral
      const [dx, dy] = [3.2 * Math.sqrt(again) * Math.cos(again * 2.4), 3.2 * Math.sqrt(again) * Math.sin(again * 2.4)];
      svg.append(h("svg:a", { href, "aria-label": words }, h("circle", { class: perturbed < clean - 0.5 ? "pair lost" : "pair", cx: x(clean) + dx, cy: y(perturbed) + dy, r: 5 }, h("title", {}, words))));
    }
    return svg;
  }

  /* Draw a change with its interval around zero, for a metric of which more is better. */
  function change([mean, low, high], reach, words) {
    const [width, height] = [150, 22];
    const x = (value) => width / 2 + (Math.min(Math.max(value, -reach), reach) / reach) * (width / 2 - 5);
    return h("svg", { class: `bullet ${high < 0 ? "fail" : low > 0 ? "pass" : "inconclusive"}`, viewBox: `0 0 ${width} ${height}`, width, height, role: "img", "aria-label": words },
      h("title", {}, words),
      h("line", { class: "axis", x1: 5, x2: width - 5, y1: 11, y2: 11 }),
      h("line", { class: "limit", x1: width / 2, x2: width / 2, y1: 3, y2: 19 }),
      h("line", { class: "interval", x1: x(low), x2: x(high), y1: 11, y2: 11 }),
      h("circle", { class: "value", cx: x(mean), cy: 11, r: 4.5 }));
  }

  return { ticks, shared, bullet, growth, scatter, change };
})();
