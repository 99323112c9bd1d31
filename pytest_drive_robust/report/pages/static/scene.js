"use strict";
/* Draws one moment of an episode from above: road, actors, lights, the ego, the plan, and the location given to it. */
driveRobust.Scene = (() => {
  const KIND = { PEDESTRIAN: 5, BICYCLE: 4, EMERGENCY: 3, CONE: 6, DIRT: 12 };
  const STATE = { BRAKING: 1, LEFT: 2, RIGHT: 4, SIREN: 8 };
  const GREEN = 0;
  const PLAN_LASTS_TICKS = 40;
  const MISPLACED_M = 0.5;
  const FRESH_S = 4;
  const UNTOUCHED = -1000000;

  function lineOf(points, path) {
    path.moveTo(points[0] / 100, points[1] / 100);
    for (let at = 2; at < points.length; at += 2) path.lineTo(points[at] / 100, points[at + 1] / 100);
    return path;
  }

  /* Return the line that lies `right` metres to the right of another line. */
  function beside(points, right) {
    const moved = [];
    const count = points.length / 2;
    for (let at = 0; at < count; at += 1) {
      const before = Math.max(at - 1, 0);
      const after = Math.min(at + 1, count - 1);
      const dx = points[2 * after] - points[2 * before];
      const dy = points[2 * after + 1] - points[2 * before + 1];
      const length = Math.hypot(dx, dy) || 1;
      moved.push(points[2 * at] - (dy / length) * right * 100, points[2 * at + 1] + (dx / length) * right * 100);
    }
    return moved;
  }

  class Scene {
    constructor({ map, motion, tracks }, episode) {
      this.map = map;
      this.motion = motion;
      this.tracks = tracks;
      this.episode = episode;
      this.size = map ? [map.ego[0] / 100, map.ego[1] / 100] : [4.9, 1.85];
      this.ticks = Math.min(motion.rows * motion.every, Math.round(episode.seconds / episode.dt));
      this.shapes = map ? this.static(map) : null;
    }

    static(map) {
      const lanes = new Map();
      const striped = new Path2D();
      const solid = new Path2D();
      const junctions = new Path2D();
      for (const [kind, junction, width, left, right, centre] of map.lanes) {
        if (centre.length < 4) continue;
        const name = `${kind} ${width}`;
        if (!lanes.has(name)) lanes.set(name, { kind, width: width / 100, path: new Path2D() });
        lineOf(centre, lanes.get(name).path);
        if (junction) { lineOf(centre, junctions); continue; }
        for (const [line, side] of [[left, -0.5], [right, 0.5]]) {
          if (line) lineOf(beside(centre, (side * width) / 100), line === 2 ? solid : striped);
        }
      }
      const crossings = new Path2D();
      for (const corners of map.crossings) { lineOf(corners, crossings); crossings.closePath(); }
      return { lanes: [...lanes.values()].sort((a, b) => b.kind - a.kind), striped, solid, junctions, crossings, route: lineOf(map.route, new Path2D()) };
    }

    /* Return the ego at a tick: metres, radians, m/s, controls 0..1. */
    at(tick) {
      const { motion } = this;
      const place = Math.min(Math.max((tick - 1) / motion.every, 0), motion.rows - 1);
      const low = Math.floor(place);
      const high = Math.min(low + 1, motion.rows - 1);
      const share = place - low;
      const mix = (values, scale) => (values[low] + (values[high] - values[low]) * share) / scale;
      return {
        x: mix(motion.x, 100), y: mix(motion.y, 100), yaw: mix(motion.yaw, 1000), speed: mix(motion.speed, 100),
        throttle: motion.throttle[low] / 1000, steer: motion.steer[low] / 1000, brake: motion.brake[low] / 1000,
        progress: mix(motion.progress, 10),
      };
    }

    hasLights() {
      return this.tracks !== null && this.map !== null && this.map.stops.some(([, , , , isLight]) => isLight);
    }

    /* Return whether the agent is told a place so far from its own that it is worth showing. */
    static isMisplaced(told) {
      return told !== null && told.off > MISPLACED_M;
    }

    /* Return the signals last given to the agent, null where no perturbation changed them. `off` and `faster` say how
       wrong place (m) and speed (m/s) were at that tick: the ego has driven on since. */
    told(tick) {
      const { told } = this.motion;
      if (!told.rows) return null;
      let low = 0;
      let high = told.rows - 1;
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (told.tick[middle] <= tick) low = middle; else high = middle - 1;
      }
      const known = (values, scale) => (values[low] === UNTOUCHED ? null : values[low] / scale);
      const [x, y, speed] = [known(told.x, 10), known(told.y, 10), known(told.speed, 10)];
      const ego = this.at(told.tick[low]);
      return {
        x, y, speed, age: known(told.age, 1),
        off: x === null ? 0 : Math.hypot(x - ego.x, y - ego.y), faster: speed === null ? 0 : speed - ego.speed,
      };
    }

    draw(context, width, height, tick, { colours, scale, twin, plan, colour, dt }) {
      const ego = this.at(tick);
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.fillStyle = colours.ground;
      context.fillRect(0, 0, context.canvas.width, context.canvas.height);
      const ratio = context.canvas.width / width;
      const k = scale * ratio;
      const c = Math.cos(ego.yaw);
      const s = Math.sin(ego.yaw);
      // the ego drives upwards: forward is -y of the canvas, right is +x
      const [a, b, d, e] = [-s * k, -c * k, c * k, -s * k];
      const [mx, my] = [(width / 2) * ratio, height * 0.7 * ratio];
      context.setTransform(a, b, d, e, mx - a * ego.x - d * ego.y, my - b * ego.x - e * ego.y);
      if (this.shapes) this.ground(context, colours);
      if (this.tracks) this.others(context, colours, tick);
      if (twin) this.vehicle(context, twin, this.size, null, colours.clean, 0.35);
      if (plan && this.tracks) this.plan(context, colours, tick);
      const told = this.told(tick);
      this.vehicle(context, ego, this.size, colour, colours.outline, 0.12);
      if (Scene.isMisplaced(told)) this.cross(context, told, colours);
      this.rings(context, colours, tick, dt);
    }

    ground(context, colours) {
      const { shapes } = this;
      context.lineCap = "butt";
      context.lineJoin = "round";
      for (const [x, y, yaw, length, width] of this.map.buildings) {
        context.save();
        context.translate(x / 100, y / 100);
        context.rotate(yaw / 1000);
        context.fillStyle = colours.building;
        context.fillRect(-length / 200, -width / 200, length / 100, width / 100);
        context.restore();
      }
      for (const { kind, width, path } of shapes.lanes) {
        context.lineWidth = width + 0.1;
        context.strokeStyle = kind === 2 ? colours.pavement : kind === 3 ? colours.cycleway : colours.road;
        context.stroke(path);
      }
      context.fillStyle = colours.crossing;
      context.fill(shapes.crossings);
      context.lineWidth = 0.15;
      context.strokeStyle = colours.line;
      context.setLineDash([3, 3]);
      context.stroke(shapes.striped);
      context.setLineDash([]);
      context.stroke(shapes.solid);
      context.lineWidth = 0.45;
      context.strokeStyle = colours.route;
      context.stroke(shapes.route);
    }

    others(context, colours, tick) {
      const { tracks } = this;
      const place = tick / tracks.every;
      for (const actor of tracks.actors) {
        const within = place - actor.first;
        if (within < 0 || within > actor.count) continue;
        const low = actor.start + Math.min(Math.floor(within), actor.count - 1);
        const high = Math.min(low + 1, actor.start + actor.count - 1);
        const share = Math.min(within - Math.floor(within), 1);
        const mix = (values, scale) => (values[low] + (values[high] - values[low]) * share) / scale;
        const pose = { x: mix(tracks.x, 100), y: mix(tracks.y, 100), yaw: mix(tracks.yaw, 1000) };
        this.actor(context, colours, actor, pose, tracks.state[low]);
      }
      const sample = Math.min(Math.max(Math.floor(place), 0), tracks.samples - 1);
      const radius = 0.6;
      (this.map ? this.map.stops : []).forEach(([x, y, heading, width, isLight, poleX, poleY], number) => {
        const state = isLight ? tracks.lights[number][sample] : 3;
        const colour = colours.lamps[state] || colours.outline;
        context.fillStyle = colour;
        context.strokeStyle = colours.outline;
        context.lineWidth = 0.12;
        context.beginPath();
        if (isLight) context.arc(poleX / 100, poleY / 100, radius, 0, 2 * Math.PI);
        else for (let side = 0; side < 8; side += 1) {
          const angle = (side + 0.5) * Math.PI / 4;
          context.lineTo(poleX / 100 + radius * Math.cos(angle), poleY / 100 + radius * Math.sin(angle));
        }
        context.closePath();
        context.fill();
        context.stroke();
        const [dx, dy] = [-Math.sin(heading / 1000) * width / 200, Math.cos(heading / 1000) * width / 200];
        context.strokeStyle = colour;
        context.lineWidth = 0.35;
        // who cannot tell green from red sees whether the way is barred
        context.setLineDash(isLight && state === GREEN ? [0.5, 0.4] : []);
        context.beginPath();
        context.moveTo(x / 100 - dx, y / 100 - dy);
        context.lineTo(x / 100 + dx, y / 100 + dy);
        context.stroke();
        context.setLineDash([]);
      });
    }

    actor(context, colours, actor, pose, state) {
      if (actor.kind === KIND.PEDESTRIAN) {
        context.fillStyle = colours.person;
        context.strokeStyle = colours.outline;
        context.lineWidth = 0.12;
        context.beginPath();
        context.arc(pose.x, pose.y, 0.55, 0, 2 * Math.PI);
        context.fill();
        context.stroke();
        return;
      }
      const size = [actor.length, actor.width];
      if (actor.kind === KIND.DIRT) { this.box(context, pose, size, colours.dirt, null, 0); return; }
      if (actor.kind >= KIND.CONE) { this.box(context, pose, size, colours.obstacle, colours.outline, 0.08); return; }
      const colour = actor.kind === KIND.EMERGENCY ? colours.emergency : actor.kind === KIND.BICYCLE ? colours.person : colours.vehicle;
      this.vehicle(context, pose, size, colour, colours.outline, 0.12);
      if (state & STATE.BRAKING) this.box(context, { ...pose, x: pose.x - Math.cos(pose.yaw) * size[0] * 0.46, y: pose.y - Math.sin(pose.yaw) * size[0] * 0.46 }, [0.35, size[1]], colours.lamps[2], null, 0);
      if (state & STATE.SIREN) this.box(context, pose, [0.5, size[1] * 0.8], colours.siren, null, 0);
    }

    box(context, pose, [length, width], fill, stroke, line) {
      context.save();
      context.translate(pose.x, pose.y);
      context.rotate(pose.yaw);
      context.beginPath();
      context.rect(-length / 2, -width / 2, length, width);
      if (fill) { context.fillStyle = fill; context.fill(); }
      if (stroke) { context.strokeStyle = stroke; context.lineWidth = line; context.stroke(); }
      context.restore();
    }

    /* A rectangle with a wedge that points ahead; without `fill` an outline only. */
    vehicle(context, pose, [length, width], fill, stroke, line) {
      this.box(context, pose, [length, width], fill, stroke, line);
      context.save();
      context.translate(pose.x, pose.y);
      context.rotate(pose.yaw);
      context.beginPath();
      context.moveTo(length * 0.42, 0);
      context.lineTo(length * 0.12, width * 0.34);
      context.lineTo(length * 0.12, -width * 0.34);
      context.closePath();
      if (fill) { context.fillStyle = stroke; context.fill(); }
      else { context.strokeStyle = stroke; context.lineWidth = line / 2; context.stroke(); }
      context.restore();
    }

    plan(context, colours, tick) {
      const { tracks } = this;
      let found = null;
      for (const plan of tracks.plans) { if (plan.tick > tick) break; found = plan; }
      if (!found || tick - found.tick > PLAN_LASTS_TICKS) return;
      const ego = this.at(found.tick);
      const [c, s] = [Math.cos(ego.yaw), Math.sin(ego.yaw)];
      const point = (row) => {
        const [f, r] = [tracks.forward[row] / 10, tracks.right[row] / 10];
        return [ego.x + c * f - s * r, ego.y + s * f + c * r];
      };
      context.strokeStyle = colours.plan;
      context.lineWidth = 0.3;
      context.beginPath();
      for (let row = 0; row < found.path; row += 1) context.lineTo(...point(found.start + row));
      context.stroke();
      const dots = (first, count, colour, radius) => {
        context.fillStyle = colour;
        for (let row = first; row < first + count; row += 1) {
          context.beginPath();
          context.arc(...point(row), radius, 0, 2 * Math.PI);
          context.fill();
        }
      };
      dots(found.start + found.path, found.targets, colours.target, 0.5);
      dots(found.start + found.path + found.targets, found.speeds, colours.plan, 0.35);
    }

    cross(context, told, colours) {
      for (const [colour, line] of [[colours.outline, 0.55], [colours.told, 0.28]]) {
        context.strokeStyle = colour;
        context.lineWidth = line;
        context.beginPath();
        context.moveTo(told.x - 0.9, told.y - 0.9);
        context.lineTo(told.x + 0.9, told.y + 0.9);
        context.moveTo(told.x - 0.9, told.y + 0.9);
        context.lineTo(told.x + 0.9, told.y - 0.9);
        context.stroke();
      }
    }

    /* Mark where something went wrong, and with a broken ring where it will in a moment: a replay starts a little before. */
    rings(context, colours, tick, dt) {
      for (const event of this.episode.events) {
        const since = event.second === null ? Infinity : tick * dt - event.second;
        if (event.x === null || since < -FRESH_S) continue;
        const near = since < FRESH_S;
        context.strokeStyle = colours.wrong;
        context.lineWidth = near && since >= 0 ? 0.5 : 0.25;
        context.setLineDash(since < 0 ? [0.8, 0.6] : []);
        context.beginPath();
        context.arc(event.x / 100, event.y / 100, near ? 3.2 : 1.6, 0, 2 * Math.PI);
        context.stroke();
        context.setLineDash([]);
      }
    }
  }

  return Scene;
})();
