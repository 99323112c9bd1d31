"use strict";
/* The replay: an episode beside its clean twin, with strips, events and a clock that both share. */
driveRobust.views.set("episode", (() => {
  const { h, link, place, fixed, seconds, breakable } = driveRobust;
  const LEAD_S = 2;
  const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
  const KINDS = {
    collisions_pedestrian: "hit a pedestrian", collisions_vehicle: "hit a vehicle", collisions_layout: "hit an obstacle",
    red_light: "ran a red light", stop_infraction: "ran a stop sign", yield_emergency_vehicle_infractions: "did not yield",
    scenario_timeouts: "scenario out of time", outside_route_lanes: "outside its lanes", route_dev: "off the route",
    vehicle_blocked: "blocked", route_timeout: "out of time", min_speed_infractions: "too slow",
  };

  /* A perturbation touches one of these signals, or else a camera, which has a name of the agent's. */
  const SIGNALS = { gps: "GPS", compass: "compass", imu: "IMU", speed: "speed", control: "control" };

  function coloursNow() {
    const style = getComputedStyle(document.documentElement);
    const get = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["ground", "road", "pavement", "cycleway", "crossing", "line", "route", "building", "outline", "vehicle", "person",
      "obstacle", "dirt", "emergency", "siren", "plan", "target", "told", "wrong", "clean", "perturbed", "ink", "faint", "rule", "page"];
    const colours = Object.fromEntries(names.map((name) => [name, get(name)]));
    colours.lamps = [get("green"), get("yellow"), get("red"), get("red")];
    return colours;
  }

  async function render(parts, query) {
    const [agent, setting, route, seed] = parts;
    const { episodes } = driveRobust;
    const episode = episodes.find(query.get("run") === "before" ? 1 : 0, agent, setting, route, Number(seed));
    if (!episode) return { title: "No such episode", nodes: [h("h1", {}, "No such episode"), h("p", {}, `This report holds no episode of ${agent} under ${setting} on route ${route} with seed ${seed}.`)] };
    const beside = companion(episode, query.get("with"));
    const scenes = await Promise.all([beside, episode].filter(Boolean).map(async (item) => ({ episode: item, data: await episodes.scene(item) })));
    return page(episode, beside, scenes, Number(query.get("t") || 0));
  }

  /* Return the episode shown beside this episode: that of the run before, the clean twin, or none. */
  function companion(episode, wish) {
    const { episodes } = driveRobust;
    if (wish === "none") return null;
    if (wish === "before" || wish === "after") {
      const other = episodes.counterpart(episode);
      if (other) return other;
    }
    return episode.twin >= 0 ? episodes.all()[episode.twin] : null;
  }

  function page(episode, beside, scenes, start) {
    const { episodes } = driveRobust;
    const run = driveRobust.given.get("run");
    const heading = [
      h("p", { class: "crumbs" }, judgedBy(run, episode).map((item, at, { length }) => [h("a", { href: driveRobust.requirementLink(item) }, driveRobust.requirementLabel(item)), at < length - 1 ? ", " : " / "]), h("a", { href: link(["episodes"], { setting: episode.setting }) }, episode.setting), " / ", h("a", { href: link(["episodes"], { scenario: episode.place.scenario }) }, episode.place.scenario)),
      h("h1", {}, breakable(episode.place.scenario), " ", h("span", { class: "soft" }, `route ${episode.route}, seed ${episode.seed}`)),
      h("p", { class: "lead" }, `${episode.agent} under ${episode.setting}: ${episode.story}${divergedOf(episode)}`),
    ];
    const shown = scenes.filter(({ data }) => data.motion);
    const moves = shown.some((scene) => scene.episode === episode);
    const player = moves ? new Player(shown, start, episode.dt) : null;
    const film = run.films[episode.number];
    const others = episodes.own().filter((item) => item.route === episode.route && item.agent === episode.agent && item.seed === episode.seed);
    return {
      title: `${episode.place.scenario} ${episode.route} under ${episode.setting}`,
      nodes: [
        ...heading,
        player ? player.nodes() : h("p", { class: "notice" }, episode.seconds ? `No trace of this episode is stored, so there is nothing to replay.${isExternal(run) ? "" : " Its line below drives it again."}` : `It ended before its first tick, so there is nothing to replay: ${episode.end}`),
        film ? h("section", {}, h("h2", {}, "What the agent saw"), h("video", { "aria-label": `What ${episode.agent} saw under ${episode.setting} on route ${episode.route}`, src: `films/${encodeURIComponent(film)}`, controls: true, preload: "metadata" }), h("p", { class: "soft" }, `films/${film}`)) : null,
        facts(episode, beside),
        others.length > 1 ? h("section", {}, h("h2", {}, "The same route under other settings"), h("ul", { class: "chips" }, others.map((item) => h("li", {}, h("a", { href: episodes.href(item, episodes.moment(item)), class: item === episode ? "here" : null, "aria-current": item === episode ? "page" : null }, item.setting, " ", h("span", { class: "soft" }, item.scored ? `DS ${fixed(item.ds, 0)} ${item.success ? "\u2713" : "\u2717"}` : "\u2013")))))) : null,
      ],
      start: player ? () => player.start() : null,
      stop: player ? () => player.stop() : null,
    };
  }

  /* Return the requirements whose verdicts read the episode: the way back to why it was driven. */
  function judgedBy(run, episode) {
    const reads = (item) => item.agent === episode.agent && item.setting === episode.setting && item.order.includes(episode.route) && item.seeds.includes(episode.seed);
    return episode.run ? [] : run.requirements.filter(reads);
  }

  function divergedOf({ parted, partedBy }) {
    return parted === null ? "" : `; diverged from its clean twin at ${seconds(parted)} ${partedBy}`;
  }

  function facts(episode, beside) {
    const run = driveRobust.given.get("run");
    const row = (name, of) => h("tr", {}, h("th", { scope: "row" }, name), [beside, episode].filter(Boolean).map((item) => h("td", {}, of(item))));
    return h("section", {},
      h("h2", {}, "In numbers"),
      driveRobust.scroller("In numbers", h("table", { class: "facts" },
        h("thead", {}, h("tr", {}, h("td", {}), [beside, episode].filter(Boolean).map((item) => h("th", { scope: "col" }, titleOf(item, episode))))),
        h("tbody", {},
          row("driving score (DS)", (item) => fixed(item.ds, 1)),
          row("route completed", (item) => (item.completion === null ? "\u2013" : `${fixed(item.completion, 1)} %`)),
          row("comfort", (item) => (item.comfort === null ? "\u2013" : `${fixed(item.comfort, 0)} %`)),
          row("efficiency", (item) => (item.efficiency === null ? "\u2013" : `${fixed(item.efficiency, 0)} %`)),
          row("driven", (item) => seconds(item.seconds)),
          row("ended", (item) => item.end)))),
      isExternal(run) ? null : h("p", {}, "Drive it again: ", h("code", {}, commandOf(run, episode))));
  }

  /* Return whether the official evaluator drove the run, now or earlier: drive-robust cannot replay its episodes. */
  function isExternal(run) {
    return ["bench2drive", "results"].includes(run.options.simulator);
  }

  /* Return the command line that drives an episode again, without options that equal their defaults. */
  function commandOf(run, episode) {
    const { options } = run;
    const words = ["drive-robust", ...(options.plugins || []).flatMap((plugin) => ["-p", plugin]), "replay", episode.route, "--agent", episode.agent, "--setting", episode.setting, "--seed", episode.seed];
    if (episode.place.file) words.push("--routes", episode.place.file);
    if (options.stuck_stop_s) words.push("--stuck-stop", options.stuck_stop_s);
    if (options.simulator !== "embedded") words.push("--sim", options.simulator);
    return words.map((word) => quoted(String(word))).join(" ");
  }

  /* Quote a word as the command line in the terminal does (report/failure.py). */
  function quoted(word) {
    if (/^[\w@%+=:,./-]+$/.test(word)) return word;
    return /["\\$`!]/.test(word) ? `'${word.replace(/'/g, `'"'"'`)}'` : `"${word}"`;
  }

  function titleOf(item, episode) {
    if (item.run !== episode.run || (item.run === 1)) return item.run === 1 ? `before: ${item.setting}` : `now: ${item.setting}`;
    return item.setting;
  }

  const CONTROLS = ["throttle", "brake", "steer"];

  /* The log of an official route has no controls: zeros over a whole episode of an external run mean unknown. */
  function knowsControls({ motion }) {
    return !isExternal(driveRobust.given.get("run")) || CONTROLS.some((name) => motion[name].some((value) => value !== 0));
  }

  class Player {
    constructor(shown, start, dt) {
      this.dt = dt;
      const own = shown[shown.length - 1].episode;
      this.panes = shown.map(({ episode, data }) => ({
        episode, role: episode === own && (shown.length > 1 || !episode.clean) ? "perturbed" : "clean", scene: new driveRobust.Scene(data, episode), controls: knowsControls(data),
      }));
      this.own = this.panes.find((pane) => pane.episode === own);
      this.twin = this.panes.find((pane) => pane !== this.own) || null;
      this.length = Math.max(...this.panes.map((pane) => pane.scene.ticks));
      this.tick = Math.min(Math.max(start / dt, 0), this.length);
      this.speed = 1;
      this.scale = 7;
      this.showPlan = true;
      this.playing = false;
      this.events = this.eventsOf();
    }

    eventsOf() {
      const events = [];
      const own = this.own.episode;
      if (own.parted !== null && this.twin) events.push({ second: own.parted, words: `the two diverge ${own.partedBy}`, kind: "parted" });
      for (const pane of this.panes) {
        for (const infraction of pane.episode.events) {
          /* Official results do not tell when an infraction happened: show it at the end of the episode. */
          events.push({ second: infraction.second ?? pane.episode.seconds, known: infraction.second !== null, words: infraction.detail || KINDS[infraction.kind] || infraction.kind, kind: pane.role, pane });
        }
        events.push({ second: pane.episode.seconds, words: pane.episode.end, kind: pane.role, pane, over: pane.episode.outcome === "completed" });
      }
      return events.sort((one, other) => one.second - other.second);
    }

    nodes() {
      const two = this.panes.length > 1;
      this.paneNodes = this.panes.map((pane) => this.paneNode(pane));
      this.range = h("input", { type: "range", min: 0, max: this.length, step: 1, value: Math.round(this.tick), "aria-label": "Time", oninput: () => this.seek(Number(this.range.value)) });
      this.clock = h("output", { class: "clock", "aria-live": "off" });
      this.playButton = h("button", { type: "button", class: "primary play", onclick: () => this.toggle() }, "Play");
      const speed = h("select", { "aria-label": "Speed", onchange: (event) => { this.speed = Number(event.target.value); } }, SPEEDS.map((value) => h("option", { value, selected: value === 1 }, `${value}\u00d7`)));
      this.speedSelect = speed;
      const zoom = h("input", { type: "range", min: 2, max: 20, step: 0.5, value: this.scale, "aria-label": "Zoom", oninput: (event) => { this.scale = Number(event.target.value); this.draw(); } });
      const plan = h("label", { class: "check" }, h("input", { type: "checkbox", checked: true, onchange: (event) => { this.showPlan = event.target.checked; this.draw(); } }), "plan");
      this.linkButton = h("button", { type: "button", onclick: () => this.copy() }, "Copy link");
      this.strips = new driveRobust.Strips(this, (tick) => this.seek(tick));
      this.eventList = h("ol", { class: "events" }, this.events.map((event) => h("li", { class: event.kind }, h("button", { type: "button", onclick: () => this.before(event) }, h("span", { class: "when" }, event.known === false ? "?" : seconds(event.second)), " ", event.pane && two ? h("span", { class: `of ${event.kind}` }, `${titleOf(event.pane.episode, this.own.episode)}: `) : null, event.words))));
      return h("div", { class: "player", role: "group", "aria-label": "Player", tabindex: "0", onkeydown: (event) => this.key(event) },
        h("div", { class: two ? "panes two" : "panes" }, this.paneNodes),
        h("div", { class: "controls", role: "group", "aria-label": "Controls" },
          this.playButton,
          h("button", { type: "button", "aria-label": "One tick back", onclick: () => this.step(-1) }, "\u2039"),
          h("button", { type: "button", "aria-label": "One tick on", onclick: () => this.step(1) }, "\u203a"),
          h("button", { type: "button", onclick: () => this.next(-1) }, "Previous event"),
          h("button", { type: "button", onclick: () => this.next(1) }, "Next event"),
          this.clock, speed, h("label", { class: "zoom" }, "zoom", zoom), plan, this.linkButton),
        this.range,
        this.strips.node,
        this.legend(two),
        h("div", { class: "below" },
          h("section", {}, h("h2", {}, "What happened"), this.eventList),
          h("section", { class: "keys" }, h("h2", {}, "Keys"), h("p", {}, "They act while the player has the focus: click on it, or reach it with Tab."), h("p", {}, KEYS.map(([key, words]) => [h("kbd", {}, key), ` ${words} `])))));
    }

    legend(two) {
      const item = (name, words) => h("li", {}, h("span", { class: `swatch ${name}`, "aria-hidden": "true" }), words);
      return h("ul", { class: "legend" },
        two ? item("clean", titleOf(this.twin.episode, this.own.episode)) : null, item(this.own.role, titleOf(this.own.episode, this.own.episode)),
        two ? item("twin", `${titleOf(this.twin.episode, this.own.episode)}, where it is at the same second`) : null,
        item("route", "route"), item("plan", "the agent's plan"),
        item("wrong", `what went wrong: a line below${two ? ` (blue for ${titleOf(this.twin.episode, this.own.episode)})` : ""}; a ring where it happened, broken before it does`),
        this.own.scene.hasLights() ? item("light", "stop line of a light, broken while green") : null,
        this.events.some((event) => event.kind === "parted") ? item("parted", "the two diverge") : null,
        this.own.episode.spans.length ? item("span", "the perturbation is at work") : null,
        this.own.scene.told(0) && this.own.scene.told(0).x !== null ? item("told", "where the agent is told it is") : null);
    }

    paneNode(pane) {
      pane.canvas = h("canvas", { role: "img", "aria-label": `${pane.episode.setting}, from above` });
      pane.speedNode = h("span", { class: "speed" });
      pane.toldNode = h("span", { class: "told" });
      pane.state = h("span", { class: "state" });
      pane.bars = ["throttle", "brake"].map((name) => ({ name, bar: h("span", { class: `bar ${name}` }) }));
      pane.steer = h("span", { class: "needle" });
      return h("figure", { class: `pane ${pane.role}` },
        h("figcaption", {}, h("strong", {}, titleOf(pane.episode, this.own.episode)), " ", h("span", { class: "soft" }, pane.episode.scored ? `DS ${fixed(pane.episode.ds, 1)}` : "not scored")),
        h("div", { class: "view" }, pane.canvas, pane.state, pane.scene.tracks ? null : h("span", { class: "no-tracks" }, "other road users were not recorded")),
        h("div", { class: "dash" }, h("span", { class: "speeds" }, pane.speedNode, pane.toldNode),
          pane.controls ? null : h("span", { class: "soft" }, "throttle, brake and steering were not recorded"),
          [...pane.bars.map(({ name, bar }) => [name, bar]), ["steer", pane.steer]].filter(() => pane.controls).map(([name, drawn]) => h("span", { class: "meter" }, h("span", { class: "label" }, name), h("span", { class: "track" }, drawn)))));
    }

    start() {
      this.colours = coloursNow();
      this.resizer = new ResizeObserver(() => this.fit());
      this.panes.forEach((pane) => this.resizer.observe(pane.canvas));
      this.resizer.observe(this.strips.canvas);
      this.onTheme = () => { this.colours = coloursNow(); this.fit(); };
      document.addEventListener("drive-robust-theme", this.onTheme);
      this.fit();
      driveRobust.player = this;
    }

    stop() {
      this.playing = false;
      this.resizer.disconnect();
      document.removeEventListener("drive-robust-theme", this.onTheme);
      driveRobust.player = null;
    }

    fit() {
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      for (const canvas of [...this.panes.map((pane) => pane.canvas), this.strips.canvas]) {
        const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
        if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      }
      this.strips.draw(ratio, this.colours);
      this.draw();
    }

    toggle() {
      this.playing = !this.playing;
      this.playButton.textContent = this.playing ? "Pause" : "Play";
      if (!this.playing) { this.remember(); return; }
      if (this.tick >= this.length) this.tick = 0;
      let last = null;
      const frame = (now) => {
        if (!this.playing) return;
        if (last !== null) this.tick += ((now - last) / 1000 / this.dt) * this.speed;
        last = now;
        if (this.tick >= this.length) { this.tick = this.length; this.toggle(); }
        this.draw();
        if (this.playing) requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    }

    seek(tick) {
      this.tick = Math.min(Math.max(tick, 0), this.length);
      this.draw();
      this.remember();
    }

    step(ticks) {
      if (this.playing) this.toggle();
      this.seek(Math.round(this.tick) + ticks);
    }

    next(way) {
      const now = this.tick * this.dt;
      const events = this.events.filter((event) => (way > 0 ? event.second > now + 0.06 : event.second < now - 0.06));
      const event = way > 0 ? events[0] : events[events.length - 1];
      if (event) { this.seek(event.second / this.dt); driveRobust.tell(`${seconds(event.second)}: ${event.words}`); }
    }

    /* Show what led to an event. */
    before(event) {
      this.seek((event.second - LEAD_S) / this.dt);
      driveRobust.tell(`${seconds(this.tick * this.dt)}, before: ${event.words}`);
    }

    remember() {
      const { query } = place();
      query.set("t", (this.tick * this.dt).toFixed(1));
      driveRobust.keep(Object.fromEntries(query));
    }

    async copy() {
      this.remember();
      try { await navigator.clipboard.writeText(location.href); this.linkButton.textContent = "Copied"; }
      catch { this.linkButton.textContent = "It is in the address bar"; }
      setTimeout(() => { this.linkButton.textContent = "Copy link"; }, 1500);
    }

    /* Called only while the player has the focus: single letters that act anywhere are pressed by speech input (WCAG 2.1.4). */
    key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const on = event.target.tagName;
      if (on === "SELECT" || (event.key === " " && (on === "BUTTON" || on === "INPUT"))) return;
      if (event.key.startsWith("Arrow") && on === "INPUT" && event.target !== this.range) return;
      const second = 1 / this.dt;
      const actions = {
        " ": () => this.toggle(), k: () => this.toggle(),
        ArrowLeft: () => this.step(event.shiftKey ? -second : -1), ArrowRight: () => this.step(event.shiftKey ? second : 1),
        j: () => this.step(-5 * second), l: () => this.step(5 * second),
        Home: () => this.seek(0), End: () => this.seek(this.length), n: () => this.next(1), p: () => this.next(-1),
        "+": () => this.faster(1), "-": () => this.faster(-1), Escape: () => { if (this.playing) this.toggle(); },
      };
      const action = actions[event.key];
      if (action) { event.preventDefault(); action(); }
    }

    faster(way) {
      this.speed = SPEEDS[Math.min(Math.max(SPEEDS.indexOf(this.speed) + way, 0), SPEEDS.length - 1)];
      this.speedSelect.value = String(this.speed);
    }

    draw() {
      if (!this.colours) return;
      const now = this.tick * this.dt;
      for (const pane of this.panes) {
        const over = this.tick >= pane.scene.ticks;
        const tick = Math.min(this.tick, pane.scene.ticks);
        const [width, height] = [pane.canvas.clientWidth, pane.canvas.clientHeight];
        if (!width || !height) continue;
        const twin = pane === this.own && this.twin ? this.twin.scene.at(Math.min(this.tick, this.twin.scene.ticks)) : null;
        pane.scene.draw(pane.canvas.getContext("2d"), width, height, tick, {
          colours: this.colours, scale: this.scale, twin, plan: this.showPlan, dt: this.dt,
          colour: pane.role === "clean" ? this.colours.clean : this.colours.perturbed,
        });
        this.dash(pane, tick, now, over);
      }
      this.range.value = Math.round(this.tick);
      this.range.setAttribute("aria-valuetext", seconds(now));
      this.clock.textContent = `${fixed(now, 2)} s`;
      this.strips.point(this.tick);
    }

    dash(pane, tick, now, over) {
      const ego = pane.scene.at(tick);
      const told = pane.scene.told(tick);
      pane.speedNode.textContent = `${Math.round(ego.speed * 3.6)} km/h`;
      pane.toldNode.textContent = [
        told && Math.abs(told.faster) > 0.3 ? `told ${Math.round(told.speed * 3.6)} km/h` : "",
        driveRobust.Scene.isMisplaced(told) ? `GPS off by ${Math.round(told.off)} m` : "",
      ].filter(Boolean).join(", ");
      for (const { name, bar } of pane.bars) bar.style.setProperty("width", `${100 * ego[name]}%`);
      pane.steer.style.setProperty("left", `${50 + 50 * ego.steer}%`);
      const signals = pane.episode.spans.filter((span) => span.first <= tick && tick <= span.last).map((span) => SIGNALS[span.signal] || `camera ${span.signal}`);
      const words = [...new Set(signals)];
      if (told && told.age !== null && told.age > 1) words.push(`picture ${fixed(told.age * this.dt, 2)} s old`);
      const event = pane.episode.events.filter((item) => item.second !== null && item.second <= now && now - item.second < 3).pop();
      const text = over ? `ended at ${seconds(pane.episode.seconds)}: ${pane.episode.end}` : event ? event.detail : words.length ? `perturbation at work: ${words.join(", ")}` : "";
      if (pane.state.textContent !== text) pane.state.textContent = text;
      pane.state.className = `state${over || event ? " wrong" : ""}${over && pane.episode.success ? " good" : ""}`;
    }
  }

  const KEYS = [["space", "play or pause"], ["\u2190 \u2192", "one tick"], ["shift + \u2190 \u2192", "one second"], ["j l", "five seconds"], ["n p", "next and previous event"], ["+ \u2212", "faster, slower"], ["esc", "pause"], ["home end", "start and end"]];

  return { render };
})());
