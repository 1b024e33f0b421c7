// Help for the hand, drawn over the ink and never part of it: vanishing lines through the cursor, ellipses of circles
// about an axis, the eraser's ring.

import { IMAGE, imageDirection, project, unproject } from "./camera.js";

export const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };
const LONG = 3 * IMAGE;
const SNAP = 9; // degrees a straight line may differ from a vanishing line to be drawn along it

/** The exact images, through a pixel, of the three lines along the world's axes: {x: [[x0, y0], [x1, y1]], ...}. */
export function vanishingLines(camera, [x, y]) {
  const lines = {};
  for (const [name, axis] of Object.entries(AXES)) {
    const direction = imageDirection(camera, [x, y], axis);
    if (!direction) continue;
    const [dx, dy] = direction;
    lines[name] = [
      [x - dx * LONG, y - dy * LONG],
      [x + dx * LONG, y + dy * LONG],
    ];
  }
  return lines;
}

/** Where a straight line from one pixel to another ends, turned onto the vanishing line that it nearly follows. */
export function snapped(camera, from, to) {
  const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
  const length = Math.hypot(dx, dy);
  if (length < 2) return { to, axis: null };
  let best = { to, axis: null, sine: Math.sin((SNAP * Math.PI) / 180) };
  for (const [name, axis] of Object.entries(AXES)) {
    const direction = imageDirection(camera, from, axis);
    if (!direction) continue;
    const sine = Math.abs(dx * direction[1] - dy * direction[0]) / length;
    if (sine >= best.sine) continue;
    const along = dx * direction[0] + dy * direction[1];
    best = { to: [from[0] + direction[0] * along, from[1] + direction[1] * along], axis: name, sine };
  }
  return best;
}

/** The image of a circle about an axis: its centre's pixel, its radius in world units, at the depth of the origin. */
export function ellipse(camera, centre, radius, axis, points = 96) {
  const depth = project(camera, [0, 0, 0])[2];
  const middle = unproject(camera, centre, depth);
  const [u, v] = Object.entries(AXES)
    .filter(([name]) => name !== axis)
    .map(([, direction]) => direction);
  return Array.from({ length: points + 1 }, (_, i) => {
    const angle = (2 * Math.PI * i) / points;
    const [c, s] = [Math.cos(angle) * radius, Math.sin(angle) * radius];
    const [x, y] = project(
      camera,
      middle.map((m, k) => m + u[k] * c + v[k] * s),
    );
    return [x, y];
  });
}

/** The radius, in world units, of the circle about an axis whose image passes as far from its centre as a pixel does. */
export function radiusTo(camera, centre, pixel, axis) {
  const unit = ellipse(camera, centre, 0.1, axis, 48);
  const widest = Math.max(...unit.map(([x, y]) => Math.hypot(x - centre[0], y - centre[1])));
  return (0.1 * Math.hypot(pixel[0] - centre[0], pixel[1] - centre[1])) / widest;
}

/** A canvas over the ink. */
export class Overlay {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.colours = { guide: "#36c", ring: "#888" };
  }

  begin() {
    const context = this.context;
    context.setTransform(1, 0, 0, 1, 0, 0);
    if (this.marked) context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.marked = false;
    const scale = this.canvas.width / IMAGE;
    context.setTransform(scale, 0, 0, scale, 0, 0);
    this.pixel = 1 / scale; // one device pixel, in pixels of the drawing
  }

  lines(camera, at, strong = null) {
    const context = this.context;
    context.strokeStyle = this.colours.guide;
    for (const [name, [from, to]] of Object.entries(vanishingLines(camera, at))) {
      context.globalAlpha = name === strong ? 0.9 : 0.5;
      context.lineWidth = (name === strong ? 2 : 1.1) * this.pixel * (window.devicePixelRatio || 1);
      context.beginPath();
      context.moveTo(...from);
      context.lineTo(...to);
      context.stroke();
    }
    context.globalAlpha = 1;
    this.marked = true;
  }

  path(points, { dashed = false, alpha = 0.9 } = {}) {
    const context = this.context;
    const ratio = this.pixel * (window.devicePixelRatio || 1);
    context.strokeStyle = this.colours.guide;
    context.globalAlpha = alpha;
    context.lineWidth = 1.5 * ratio;
    context.setLineDash(dashed ? [5 * ratio, 4 * ratio] : []);
    context.beginPath();
    points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
    this.marked = true;
  }

  ring([x, y], radius) {
    const context = this.context;
    context.strokeStyle = this.colours.ring;
    context.lineWidth = 1.25 * this.pixel * (window.devicePixelRatio || 1);
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
    this.marked = true;
  }

  /** Where the pen is: a dot that a small cross-hair of vanishing lines cannot hide. */
  dot([x, y], radius, colour) {
    const context = this.context;
    context.fillStyle = colour;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
    this.marked = true;
  }
}
