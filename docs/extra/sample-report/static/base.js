"use strict";
/* Helpers of every view: data that scripts pass to the page, elements, links, numbers and words. */
const driveRobust = (() => {
  const given = new Map();
  const waiting = new Map();
  const views = new Map();

  /* Called by the scripts in data/. */
  function give(name, data) {
    given.set(name, data);
    const settle = waiting.get(name);
    if (settle) settle.resolve(data);
  }

  /* Return a promise of the data of data/NAME.js. A page on a disk may load scripts, and nothing else. */
  function load(name) {
    if (given.has(name)) return Promise.resolve(given.get(name));
    if (waiting.has(name)) return waiting.get(name).promise;
    const settle = {};
    settle.promise = new Promise((resolve, reject) => { settle.resolve = resolve; settle.reject = reject; });
    waiting.set(name, settle);
    const script = document.createElement("script");
    script.src = `data/${name}.js`;
    script.onerror = () => settle.reject(new Error(`data/${name}.js is not there`));
    document.head.append(script);
    return settle.promise;
  }

  const NS = "http://www.w3.org/2000/svg";
  const SVG = new Set(["svg", "g", "path", "line", "circle", "rect", "text", "polyline", "polygon", "title", "desc"]);

  /* Return a new element: h("a", {href: "#/"}, "text", child). Text is inserted as text, never as markup. */
  function h(name, attributes, ...children) {
    const svg = SVG.has(name) || name === "svg:a";
    const element = svg ? document.createElementNS(NS, name.replace("svg:", "")) : document.createElement(name);
    for (const [key, value] of Object.entries(attributes || {})) {
      if (value === null || value === undefined || value === false) continue;
      if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
      else if (key === "vars") for (const [word, number] of Object.entries(value)) element.style.setProperty(`--${word}`, number);
      else element.setAttribute(key, value === true ? "" : String(value));
    }
    for (const child of children.flat(Infinity)) {
      if (child === null || child === undefined || child === false) continue;
      element.append(child instanceof Node ? child : String(child));
    }
    return element;
  }

  /* --- links: #/view/part/part?name=value --- */
  function link(parts, query) {
    const path = parts.map((part) => encodeURIComponent(part)).join("/");
    const words = Object.entries(query || {}).filter(([, value]) => value !== "" && value !== null && value !== undefined);
    const search = new URLSearchParams(words.map(([key, value]) => [key, String(value)])).toString();
    return `#/${path}${search ? `?${search}` : ""}`;
  }

  function place() {
    const [path, search] = location.hash.replace(/^#\/?/, "").split("?", 2);
    const parts = path.split("/").filter(Boolean).map((part) => {
      try { return decodeURIComponent(part); } catch { return part; }
    });
    return { parts, query: new URLSearchParams(search || "") };
  }

  /* Change the part of the address after the question mark without leaving the view. */
  function keep(query) {
    const { parts } = place();
    history.replaceState(null, "", link(parts, query));
  }

  /* --- numbers and words --- */
  const MINUS = "\u2212";
  /* Return the size of a value rounded as Python does: half to even, where toFixed rounds half up. */
  function rounded(value, decimals) {
    const text = Math.abs(value).toFixed(decimals);
    const halfway = (Math.abs(value) * 2 ** (decimals + 1)) % 2 === 1;
    return halfway && text.at(-1) % 2 ? (text - 10 ** -decimals).toFixed(decimals) : text;
  }
  function fixed(value, decimals) {
    if (value === null || value === undefined) return "\u2013";
    const text = rounded(value, decimals);
    return value < 0 && Number(text) !== 0 ? MINUS + text : text;
  }
  /* Metrics have as many decimals as in the terminal (report/numbers.py). */
  const DECIMALS = 2;
  function shown(value) {
    return fixed(value, DECIMALS);
  }
  /* Return a value with as many decimals as it takes to tell the value from the limits beside it. */
  function shownBeside(value, ...limits) {
    if (value === null || value === undefined) return fixed(value, 0);
    const side = (number, limit) => (Math.abs(number - limit) <= 1e-9 * Math.max(1, Math.abs(limit)) ? 0 : Math.sign(number - limit));
    let decimals = DECIMALS;
    while (decimals < 9 && limits.some((limit) => side(Math.sign(value) * rounded(value, decimals), limit) !== side(value, limit))) decimals += 1;
    return fixed(value, decimals);
  }
  /* Return a limit as its requirement states it. */
  function shownLimit(metric, limit) {
    const decimals = given.get("run").metrics[metric]?.decimals ?? 0;
    return Number(limit.toFixed(decimals)) === limit ? fixed(limit, decimals) : String(limit).replace("-", MINUS);
  }
  function signed(value, decimals) {
    return value > 0 ? `+${fixed(value, decimals)}` : fixed(value, decimals);
  }
  /* Return an interval, with as many decimals as it takes to tell whether it contains one of the limits. */
  function between(metric, low, high, ...limits) {
    if (low === null && high === null) return "";
    const word = (value) => (value === null ? "no bound" : metric === "RD" && value < -1 ? `< ${MINUS}1` : shownBeside(value, ...limits));
    return `${word(low)} to ${word(high)}`;
  }
  /* Return a time of an episode rounded as in the sentences of verdict/explain.py: 7.25 is 7.3. */
  function seconds(value) {
    return `${fixed(Math.floor(Number((10 * value).toFixed(6)) + 0.5) / 10, 1)} s`;
  }
  function duration(value) {
    if (value < 120) return `${Math.round(value)} s`;
    return value < 7200 ? `${Math.round(value / 60)} min` : `${fixed(value / 3600, 1)} h`;
  }
  function counted(count, word) {
    return `${count} ${word}${count === 1 ? "" : "s"}`;
  }

  /* Return a text that may break behind a comma and within a name of several words, where a narrow screen would break it between any two letters. */
  function breakable(text) {
    return text.split(/(?<=,)|(?<=[a-z])(?=[A-Z])/).flatMap((part, at) => (at ? [h("wbr", {}), part] : [part]));
  }

  const VERDICTS = {
    pass: { sign: "\u2713", word: "pass" },
    fail: { sign: "\u2717", word: "fail" },
    inconclusive: { sign: "~", word: "inconclusive" },
    error: { sign: "!", word: "error" },
    "-": { sign: "\u00b7", word: "no requirement" },
  };
  function badge(verdict) {
    const known = VERDICTS[verdict] || VERDICTS["-"];
    return h("span", { class: `badge ${verdict === "-" ? "none" : verdict}` }, h("span", { "aria-hidden": "true" }, known.sign), " ", known.word);
  }

  function tell(text) {
    document.getElementById("told").textContent = text;
  }

  /* Return a scrolling frame around a wide table; it can be reached by keyboard. */
  function scroller(label, ...children) {
    return h("div", { class: "scroller", role: "region", "aria-label": label, tabindex: "0" }, children);
  }

  return {
    give, load, given, views, h, link, place, keep, fixed, shown, shownBeside, shownLimit, signed, between, seconds, duration, counted, breakable, badge,
    tell, scroller,
  };
})();
