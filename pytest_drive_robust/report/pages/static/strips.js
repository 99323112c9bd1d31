"use strict";
/* Draws speed, throttle, brake and steering of the episodes of a replay over time, above each other, with its events. */
driveRobust.Strips = (() => {
  const { h, seconds } = driveRobust;
  const AXIS = 16;
  const NAME = 16;
  const ROWS = [["speed", 0.46], ["throttle", 0.18], ["brake", 0.18], ["steer", 0.18]];

  class Strips {
    /* `seek` is called with the tick that a pointer chose. */
    constructor({ panes, own, events, length, dt }, seek) {
      this.panes = panes;
      this.events = events;
      this.length = length;
      this.dt = dt;
      this.seek = seek;
      const { episode } = own;
      this.spans = episode.spans;
      this.fastest = Math.max(5, ...panes.flatMap((pane) => [Math.max(...pane.scene.motion.speed) / 100]));
      this.canvas = h("canvas", { class: "strips", role: "img", "aria-label": `Speed, throttle, brake and steering over ${seconds(episode.seconds)}. ${episode.story}.` });
      this.cursor = h("div", { class: "cursor" });
      this.node = h("div", { class: "strip-frame", onpointerdown: (event) => this.drag(event) }, this.canvas, this.cursor);
    }

    drag(event) {
      const move = (moved) => {
        const box = this.canvas.getBoundingClientRect();
        this.seek(((moved.clientX - box.left) / box.width) * this.length);
      };
      move(event);
      this.node.setPointerCapture(event.pointerId);
      this.node.onpointermove = move;
      this.node.onpointerup = () => { this.node.onpointermove = null; };
    }

    /* Move the cursor to a tick. */
    point(tick) {
      this.cursor.style.setProperty("left", `${(100 * tick) / this.length}%`);
    }

    draw(ratio, colours) {
      const context = this.canvas.getContext("2d");
      const width = this.canvas.clientWidth;
      const height = this.canvas.clientHeight - AXIS;
      if (!width) return;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, width, height + AXIS);
      context.font = "11px system-ui, sans-serif";
      const area = { context, colours, width, height, rows: [...this.rows(height)], x: (tick) => (tick / this.length) * width };
      this.drawSpans(area);
      this.drawMotion(area);
      this.drawSeconds(area);
      this.drawEvents(area);
      this.drawNames(area);
    }

    /* Yield each strip with its top and its height, below a line for its name. */
    *rows(height) {
      let top = 0;
      for (const [name, share] of ROWS) {
        const high = (height - ROWS.length * NAME) * share;
        yield { name, top: top + NAME, high };
        top += NAME + high;
      }
    }

    /* Shade where the perturbation is at work. */
    drawSpans({ context, colours, height, x }) {
      context.fillStyle = colours.perturbed;
      context.globalAlpha = 0.13;
      for (const span of this.spans) context.fillRect(x(span.first), 0, Math.max(1, x(span.last + 1) - x(span.first)), height);
      context.globalAlpha = 1;
    }

    drawMotion({ context, colours, width, rows, x }) {
      for (const { name, top, high } of rows) {
        context.strokeStyle = colours.rule;
        context.lineWidth = 1;
        context.strokeRect(0.5, Math.round(top) + 0.5, width - 1, Math.round(high) - 1);
        if (name === "steer") context.strokeRect(0.5, Math.round(top + high / 2) + 0.5, width - 1, 0);
        for (const pane of this.panes.filter(({ controls }) => controls || name === "speed")) {
          const { motion } = pane.scene;
          context.strokeStyle = pane.role === "clean" ? colours.clean : colours.perturbed;
          context.lineWidth = 1.5;
          context.beginPath();
          for (let row = 0; row < motion.rows; row += 1) {
            const value = name === "speed" ? motion.speed[row] / 100 / this.fastest : name === "steer" ? 0.5 - motion.steer[row] / 2000 : motion[name][row] / 1000;
            context.lineTo(x(row * motion.every + 1), top + high - 2 - value * (high - 4));
          }
          context.stroke();
        }
      }
    }

    /* The axis of time below the strips. */
    drawSeconds({ context, colours, width, height }) {
      const last = this.length * this.dt;
      context.fillStyle = colours.faint;
      context.strokeStyle = colours.rule;
      context.lineWidth = 1;
      for (const second of driveRobust.charts.ticks(0, last, Math.max(2, Math.floor(width / 90)))) {
        const at = Math.round((second / last) * width) + 0.5;
        context.beginPath();
        context.moveTo(at, height);
        context.lineTo(at, height + 4);
        context.stroke();
        const words = `${Number(second.toFixed(2))} s`;
        const wide = context.measureText(words).width;
        context.fillText(words, Math.min(Math.max(at - wide / 2, 0), width - wide), height + 14);
      }
    }

    drawEvents({ context, colours, width, height, x }) {
      const drawn = new Set();
      for (const event of this.events) {
        const at = Math.min(Math.round(x(event.second / this.dt)), width - 1) + 0.5;
        if (drawn.has(at)) continue;
        drawn.add(at);
        context.strokeStyle = event.kind === "parted" ? colours.ink : event.kind === "clean" ? colours.clean : event.over ? colours.perturbed : colours.wrong;
        context.setLineDash(event.kind === "parted" ? [4, 3] : []);
        context.lineWidth = 1.5;
        context.beginPath();
        context.moveTo(at, 0);
        context.lineTo(at, height);
        context.stroke();
        context.setLineDash([]);
      }
    }

    /* The name of each strip, above it, and over the lines of the events. */
    drawNames({ context, colours, rows }) {
      context.lineWidth = 4;
      context.lineJoin = "round";
      context.strokeStyle = colours.page;
      context.fillStyle = colours.faint;
      for (const { name, top } of rows) {
        const words = { speed: `speed, 0 to ${Math.round(this.fastest * 3.6)} km/h`, steer: "steer, left is up" }[name] || `${name}, 0 to 1`;
        context.strokeText(words, 4, top - 4);
        context.fillText(words, 4, top - 4);
      }
    }
  }

  return Strips;
})();
