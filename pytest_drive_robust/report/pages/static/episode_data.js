"use strict";
/* Episodes: the columns of data/run.js as objects, and the motion of one episode out of data/route-N.js. */
driveRobust.episodes = (() => {
  const { load } = driveRobust;
  let rows = null;

  /* Return every episode as an object; those of the run come first, then those of the run before. */
  function all() {
    if (rows) return rows;
    const run = driveRobust.given.get("run");
    const columns = run.episodes;
    const word = (number) => columns.words[number];
    const places = new Map(run.routes.map((route, number) => [route.id, number]));
    rows = columns.run.map((of, number) => {
      const route = word(columns.route[number]);
      return {
        number, run: of, route, routeNumber: places.get(route), place: run.routes[places.get(route)],
        agent: word(columns.agent[number]), setting: word(columns.setting[number]), seed: columns.seed[number],
        outcome: word(columns.outcome[number]), end: untimed(word(columns.end[number])), story: word(columns.story[number]),
        ds: columns.ds[number], success: columns.success[number] === 1, scored: columns.ds[number] !== null,
        completion: columns.completion[number], efficiency: columns.efficiency[number], comfort: columns.comfort[number],
        seconds: columns.seconds[number], dt: columns.dt[number], clean: columns.clean[number] === 1, wall: columns.wall[number], twin: columns.twin[number],
        parted: columns.parted[number], partedBy: word(columns.partedBy[number]),
        events: columns.events[number].map(([kind, second, detail, x, y]) => ({ kind: word(kind), second, detail: word(detail), x, y })),
        spans: columns.spans[number].map(([signal, first, last]) => ({ signal: word(signal), first, last })),
        trace: columns.trace[number], key: columns.key[number], cluster: -1,
      };
    });
    run.clusters.forEach((cluster, number) => cluster.episodes.forEach((episode) => { rows[episode].cluster = number; }));
    return rows;
  }

  /* Return how an episode ended without its second: every view shows the second beside these words, rounded as all others are. */
  function untimed(end) {
    return end.replace(/^(reached the end|left the route) at \d+\.\d s$/, "$1");
  }

  function own() {
    return all().filter((episode) => episode.run === 0);
  }

  /* The agents of the run: with several agents, setting and route do not identify an episode. */
  function agents() {
    return [...new Set(own().map((episode) => episode.agent))];
  }

  function find(run, agent, setting, route, seed) {
    return all().find((item) => item.run === run && item.agent === agent && item.setting === setting && item.route === route && item.seed === seed);
  }

  /* Return the episode of the other run on equal setting, route and seed; its agent may have another name. */
  function counterpart(episode) {
    const { comparison } = driveRobust.given.get("run");
    const [here, there] = episode.run ? ["agentBefore", "agent"] : ["agent", "agentBefore"];
    const cell = comparison && comparison.settings.find((item) => item[here] === episode.agent);
    return cell && find(1 - episode.run, cell[there], episode.setting, episode.route, episode.seed);
  }

  /* Return the link to a second of an episode. */
  function href(episode, second, query) {
    const words = { t: second === undefined || second === null ? "" : Math.max(0, second).toFixed(1), run: episode.run ? "before" : "", ...query };
    return driveRobust.link(["episode", episode.agent, episode.setting, episode.route, episode.seed], words);
  }

  /* Return the second to show first: a little before the first infraction, or before the two egos parted. */
  function moment(episode) {
    const first = episode.events.find((event) => event.x !== null && event.second !== null);
    if (first) return first.second - 3;
    if (episode.parted !== null) return episode.parted - 1;
    return 0;
  }

  async function inflate(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new DataView(await new Response(stream).arrayBuffer());
  }

  /* Read tables of whole numbers, see store/track_bytes.py: byte planes of each column, zigzag. */
  class Tables {
    constructor(view, place) { this.view = view; this.place = place; }
    next(length, width) {
      const bytes = new Uint8Array(this.view.buffer, this.place, 4 * length * width);
      this.place += 4 * length * width;
      const columns = [];
      for (let column = 0; column < width; column += 1) {
        const values = new Int32Array(length);
        const start = 4 * length * column;
        for (let row = 0; row < length; row += 1) {
          const at = start + row;
          const zigzag = (bytes[at] | (bytes[at + length] << 8) | (bytes[at + 2 * length] << 16) | (bytes[at + 3 * length] << 24)) >>> 0;
          values[row] = (zigzag >>> 1) ^ -(zigzag & 1);
        }
        columns.push(values);
      }
      return columns;
    }
  }

  /* Turn differences into sums, starting again at each of `starts`. */
  function sum(values, starts) {
    let next = 0;
    for (let row = 1; row < values.length; row += 1) {
      while (next < starts.length && starts[next] < row) next += 1;
      if (starts[next] !== row) values[row] += values[row - 1];
    }
    return values;
  }

  function startsOf(counts) {
    const starts = [];
    let place = 0;
    for (const count of counts) {
      if (count > 0) starts.push(place);
      place += count;
    }
    return starts;
  }

  async function motion(text) {
    const view = await inflate(text);
    const [version, every, rows, told] = [0, 4, 8, 12].map((at) => view.getUint32(at, true));
    if (version !== 1) throw new Error(`motion of version ${version}`);
    const tables = new Tables(view, 16);
    const [x, y, yaw, speed, throttle, steer, brake, progress] = tables.next(rows, 8).map((values) => sum(values, [0]));
    sum(x, [0]);
    sum(y, [0]);
    const [tick, gpsX, gpsY, toldSpeed, age] = tables.next(told, 5).map((values) => sum(values, [0]));
    return { every, rows, x, y, yaw, speed, throttle, steer, brake, progress, told: { rows: told, tick, x: gpsX, y: gpsY, speed: toldSpeed, age } };
  }

  async function tracks(text) {
    if (!text) return null;
    const view = await inflate(text);
    const [version, every, actorRows, motionRows, samples, plans, points, lines] = Array.from({ length: 8 }, (_, at) => view.getUint32(4 * at, true));
    if (version !== 1) throw new Error(`tracks of version ${version}`);
    const tables = new Tables(view, 32);
    const [id, kind, length, width, first, count] = tables.next(actorRows, 6);
    const starts = startsOf(count);
    const [x, y, yaw, state] = tables.next(motionRows, 4).map((values) => sum(values, starts));
    sum(x, starts);
    sum(y, starts);
    const lights = tables.next(samples, lines).map((values) => sum(values, [0]));
    const heads = tables.next(plans, 4).map((values) => sum(values, [0]));
    const pointCounts = Array.from(heads[0], (_, row) => heads[1][row] + heads[2][row] + heads[3][row]);
    const pointStarts = startsOf(pointCounts);
    const [forward, right] = tables.next(points, 2).map((values) => sum(values, pointStarts));
    const actors = [];
    let place = 0;
    for (let row = 0; row < actorRows; row += 1) {
      actors.push({ id: id[row], kind: kind[row], length: length[row] / 100, width: width[row] / 100, first: first[row], count: count[row], start: place });
      place += count[row];
    }
    let point = 0;
    const planned = Array.from(heads[0], (tick, row) => {
      const plan = { tick, start: point, path: heads[1][row], targets: heads[2][row], speeds: heads[3][row] };
      point += pointCounts[row];
      return plan;
    });
    return { every, samples, actors, x, y, yaw, state, lights, plans: planned, forward, right };
  }

  /* Return the motion, the tracks and the map of an episode, each null where missing. */
  async function scene(episode) {
    const file = await load(`route-${episode.routeNumber}`);
    const [moved, seen] = file.episodes[episode.number] || ["", ""];
    const map = file.maps[String(episode.seed)] || file.maps.any || null;
    return { map, motion: moved ? await motion(moved) : null, tracks: await tracks(seen) };
  }

  return { all, own, agents, find, counterpart, href, moment, scene };
})();
