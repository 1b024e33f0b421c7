// Ink as it is laid down: strokes of [x, y, pressure] in pixels of the drawing (256 x 256), drawn on a canvas.

import { IMAGE } from "./camera.js";

const WIDTH = [1.5, 2.5]; // pixels of the drawing at no pressure and at full pressure, as the networks see them
const NEAR = 0.35; // pixels of the drawing: points nearer to the last one say nothing new

export function newId() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A stroke that is being drawn; `add` tells which of its points are new. */
export class Stroke {
  constructor(kind, points = []) {
    this.id = newId();
    this.kind = kind;
    this.points = points;
  }

  /** Adds a point, if it is not all but the last one again; true if it was added. */
  add(x, y, pressure) {
    const last = this.points.at(-1);
    if (last && Math.hypot(x - last[0], y - last[1]) < NEAR) return false;
    const round = (value) => Math.round(value * 100) / 100;
    this.points.push([round(x), round(y), round(Math.min(1, Math.max(0, pressure)))]);
    return true;
  }

  get data() {
    return { id: this.id, kind: this.kind, points: this.points };
  }
}

/** Points of a straight stroke, about two pixels apart, so that an eraser and a pressure have something to hold on to. */
export function straight([x0, y0], [x1, y1], pressure = 0.5) {
  const steps = Math.max(1, Math.ceil(Math.hypot(x1 - x0, y1 - y0) / 2));
  return Array.from({ length: steps + 1 }, (_, i) => {
    const share = i / steps;
    return [x0 + (x1 - x0) * share, y0 + (y1 - y0) * share, pressure];
  });
}

/** A canvas of one drawing: `scale` device pixels a pixel of the drawing. */
export class Paper {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { desynchronized: true });
    this.colours = { ink: "#111", construction: "#c22" };
    this.scale = 1;
  }

  /** The side of the canvas in device pixels; clears it when it changes. */
  resize(side) {
    if (this.canvas.width === side && this.canvas.height === side) return;
    this.canvas.width = this.canvas.height = side;
    this.scale = side / IMAGE;
  }

  clear() {
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  /** Draws a stroke's points from one index on; what comes before is there already. */
  stroke({ points, kind }, from = 0, faint = 1) {
    const context = this.context;
    context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = faint * (kind === "construction" ? 0.75 : 1);
    context.strokeStyle = context.fillStyle = this.colours[kind];
    context.lineCap = context.lineJoin = "round";
    const thin = kind === "construction" ? 0.55 : 0.75; // slightly thinner than the networks' pixels, for the eye
    const width = (pressure) => (WIDTH[0] + (WIDTH[1] - WIDTH[0]) * pressure) * thin;
    if (points.length === 1 || from === 0) {
      const [x, y, pressure] = points[0];
      context.beginPath();
      context.arc(x, y, width(pressure) / 2, 0, 2 * Math.PI);
      context.fill();
    }
    let i = Math.max(1, from);
    while (i < points.length) {
      // One path as long as the width stays about the same: a pen's line, without seams where its pieces meet.
      const step = Math.round(points[i][2] * 8);
      context.beginPath();
      context.moveTo(points[i - 1][0], points[i - 1][1]);
      for (; i < points.length && Math.round(points[i][2] * 8) === step; i++) context.lineTo(points[i][0], points[i][1]);
      context.lineWidth = width(step / 8);
      context.stroke();
    }
    context.globalAlpha = 1;
  }

  /** Takes away what an eraser passes over, from one index of its path on. */
  erase(path, radius, from = 0) {
    const context = this.context;
    context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    context.globalCompositeOperation = "destination-out";
    context.lineCap = context.lineJoin = "round";
    context.lineWidth = 2 * radius;
    context.beginPath();
    const start = path[Math.max(0, from - 1)];
    context.moveTo(start[0], start[1]);
    for (const [x, y] of path.slice(from)) context.lineTo(x, y);
    if (path.length === 1) context.lineTo(start[0] + 0.01, start[1]);
    context.stroke();
    context.globalCompositeOperation = "source-over";
  }
}

/** What a drawing looks like once everything that waits in the outbox has been done to it. */
export function pending(strokes, operations, viewpoint) {
  const known = new Set(strokes.map((stroke) => stroke.id));
  const steps = [{ strokes }];
  for (const { path, body } of operations) {
    if (body.viewpoint !== viewpoint) continue;
    if (path === "strokes") steps.push({ strokes: body.strokes.filter((stroke) => !known.has(stroke.id)) });
    else if (path === "erase") steps.push({ erase: body.path, radius: body.radius });
  }
  return steps;
}
