// The stage: canvas and 3D viewer at once. The solid below, ink above, guides on top; drawing from the viewpoints,
// turning freely in between, and the animated way from the one to the other.

import { IMAGE, between, nearest, orbit, placeOf, unpack } from "./camera.js";
import { Overlay, ellipse, radiusTo, snapped } from "./guides.js";
import { Paper, Stroke, pending, straight } from "./ink.js";
import { Pointers } from "./pointers.js";
import { VolumeView } from "./volume.js";

const SNAP = 420; // milliseconds that the way to a viewpoint takes
const FAINT = 0.26; // opacity of the solid as a reference under a drawing
const DISTANCES = [1.15, 5];
const ERASER = [2, 24];
const ease = (t) => (t < 0.5 ? 4 * t ** 3 : 1 - (2 - 2 * t) ** 3 / 2);

export class Stage {
  /**
   * @param root holds three canvases: .volume, .ink, .guides; and .paper, the sheet behind them.
   * @param viewpoints name -> packed camera, as Python sends them.
   * @param heard {stroke(viewpoint, data), erase(viewpoint, path, radius), view(name or null), swept()}.
   */
  constructor(root, viewpoints, heard) {
    this.root = root;
    this.heard = heard;
    this.cameras = Object.fromEntries(Object.entries(viewpoints).map(([name, row]) => [name, unpack(row)]));
    this.viewpoint = Object.keys(viewpoints)[0];
    this.camera = this.cameras[this.viewpoint];
    this.mode = "draw";
    this.tool = "pen";
    this.axis = "y";
    this.kind = "ink"; // of lines that tools lay down
    this.ruler = false;
    this.radius = 0.15; // of the ellipse guide's circle, world units
    this.eraser = 6;
    this.faint = 0; // how far the solid has faded to a reference: 0 .. 1
    this.steps = [];
    this.reference = [];
    const canvas = (name) => root.querySelector(`canvas.${name}`);
    this.paper = new Paper(canvas("ink"));
    this.overlay = new Overlay(canvas("guides"));
    this.view = new VolumeView(canvas("volume"), () => this.frame());
    this.pointers = new Pointers(root, this);
    new ResizeObserver(() => this.resize()).observe(root);
    this.resize();
    this.fade(0);
  }

  // Where things are

  resize() {
    const { clientWidth: width, clientHeight: height } = this.root;
    const style = getComputedStyle(this.root);
    const inset = (side) => parseFloat(style.getPropertyValue(`--inset-${side}`)) || 0;
    const [left, right, top, bottom] = ["left", "right", "top", "bottom"].map(inset);
    const side = Math.max(120, Math.floor(Math.min(width - left - right, height - top - bottom)));
    const x = Math.round(left + (width - left - right - side) / 2);
    const y = Math.round(top + (height - top - bottom - side) / 2);
    this.area = { x, y, side };
    this.root.dataset.area = `${x} ${y} ${side}`;
    for (const element of this.root.querySelectorAll(".square"))
      Object.assign(element.style, { left: `${x}px`, top: `${y}px`, width: `${side}px`, height: `${side}px` });
    const pixels = Math.round(side * (window.devicePixelRatio || 1));
    this.paper.resize(pixels);
    this.overlay.canvas.width = this.overlay.canvas.height = pixels;
    this.redraw();
    this.view.invalidate();
  }

  /** A place of the page as [x, y] in pixels of the drawing. */
  toDrawing({ clientX, clientY }) {
    const scale = IMAGE / this.area.side;
    return [(clientX - this.rect.left - this.area.x) * scale, (clientY - this.rect.top - this.area.y) * scale];
  }

  get rect() {
    return this.root.getBoundingClientRect();
  }

  // What is seen

  /** Colours from the style sheet, after a change of theme. */
  paint() {
    const style = getComputedStyle(this.root);
    const token = (name) => style.getPropertyValue(`--${name}`).trim();
    const rgb = (name) => parseColour(token(name));
    this.paper.colours = { ink: token("ink"), construction: token("construction") };
    this.overlay.colours = { guide: token("guide"), ring: token("muted") };
    this.view.colours = { clay: rgb("clay"), alarm: rgb("alarm"), line: rgb("grid"), edge: rgb("edge") };
    this.redraw();
    this.view.invalidate();
  }

  /** The drawing from this viewpoint, and what waits to be done to it; lines of other parts as a reference. */
  show(strokes, operations, reference = []) {
    this.steps = pending(strokes, operations, this.viewpoint);
    this.reference = reference;
    this.redraw();
  }

  redraw() {
    this.paper.clear();
    for (const stroke of this.reference) this.paper.stroke(stroke, 0, 0.45);
    for (const step of this.steps) {
      for (const stroke of step.strokes ?? []) this.paper.stroke(stroke);
      if (step.erase) this.paper.erase(step.erase, step.radius);
    }
    const live = this.pointers?.live;
    if (live?.stroke) this.paper.stroke(live.stroke);
    if (live?.path) this.paper.erase(live.path, this.eraser);
  }

  /** Called by the view before each frame. */
  frame() {
    const now = performance.now();
    let moving = false;
    if (this.flight) {
      const share = Math.min(1, (now - this.flight.begun) / this.flight.lasts);
      const place = between(this.flight.from, this.flight.to, ease(share));
      this.camera = share < 1 ? orbit(place, this.camera.tan) : this.flight.camera;
      moving = true;
      if (share === 1) this.land();
    }
    if (this.fading) {
      const share = Math.min(1, (now - this.fading.begun) / this.fading.lasts);
      this.setFaint(this.fading.from + (this.fading.to - this.fading.from) * share);
      if (share === 1) this.fading = null;
      else moving = true;
    }
    const { x, y, side } = this.area;
    return { camera: this.camera, centre: [x + side / 2, y + side / 2], side, moving, held: this.pointers?.turning ?? false };
  }

  setFaint(faint) {
    this.faint = faint;
    Object.assign(this.view.look, { opacity: 1 - (1 - FAINT) * faint, cube: 1 - 0.25 * faint, grid: 1 - 0.45 * faint });
  }

  fade(to, lasts = 220) {
    this.fading = { from: this.faint, to, begun: performance.now(), lasts: still() ? 1 : lasts };
    this.view.invalidate(true);
  }

  // Drawing and navigating

  /** Turns to a viewpoint, and draws from there on. */
  draw(viewpoint) {
    const camera = this.cameras[viewpoint];
    this.mode = "flying";
    this.viewpoint = viewpoint;
    this.flight = {
      camera,
      from: placeOf(this.camera),
      to: placeOf(camera),
      begun: performance.now(),
      lasts: this.camera === camera || still() ? 1 : SNAP,
    };
    this.root.dataset.mode = "navigate";
    this.overlay.begin();
    this.fade(1, SNAP);
    this.heard.view(viewpoint);
  }

  land() {
    this.flight = null;
    this.mode = "draw";
    this.root.dataset.mode = "draw";
    this.redraw();
    this.heard.landed?.(this.viewpoint);
  }

  navigate() {
    if (this.mode === "navigate") return;
    this.pointers.cancel();
    this.flight = null;
    this.mode = "navigate";
    this.root.dataset.mode = "navigate";
    this.overlay.begin();
    this.fade(0);
    this.heard.view(null);
  }

  /** The viewpoint, of those allowed, that is nearest to where one looks from. */
  nearest(allowed) {
    return nearest(this.camera, Object.fromEntries(allowed.map((name) => [name, this.cameras[name]])));
  }

  get place() {
    return placeOf(this.camera);
  }

  turn(degreesRight, degreesDown) {
    const place = placeOf(this.camera);
    place.azimuth += degreesRight;
    place.elevation = Math.max(-89, Math.min(89.9, place.elevation + degreesDown));
    this.look(place);
  }

  zoom(factor) {
    const place = placeOf(this.camera);
    place.distance = Math.max(DISTANCES[0], Math.min(DISTANCES[1], place.distance * factor));
    this.look(place);
  }

  look(place) {
    this.flight = null;
    this.camera = orbit(place, this.camera.tan);
    this.view.invalidate(true);
  }

  // Guides at the cursor: in draw mode only.

  hover(at, straightTo = null) {
    this.overlay.begin();
    if (this.mode !== "draw" || !at || Math.min(...at) < -4 || Math.max(...at) > IMAGE + 4) return;
    if (this.tool === "eraser") return this.overlay.ring(at, this.eraser);
    if (this.tool === "ellipse") {
      this.overlay.lines(this.camera, straightTo?.from ?? at, this.axis);
      this.overlay.path(ellipse(this.camera, straightTo?.from ?? at, this.radius, this.axis));
      return;
    }
    this.overlay.lines(this.camera, at, straightTo?.axis);
    if (straightTo) this.overlay.path([straightTo.from, straightTo.to], { alpha: 1 });
    this.overlay.dot(at, 1.1, this.paper.colours[this.kind]);
  }

  resizeTool(factor) {
    if (this.tool === "ellipse") this.radius = Math.max(0.02, Math.min(0.7, this.radius * factor));
    else this.eraser = Math.max(ERASER[0], Math.min(ERASER[1], this.eraser * factor));
    this.hover(this.pointers.at);
  }

  // What a pointer does in draw mode (pointers.js calls these with places in pixels of the drawing).

  begin(at, pressure, eraser) {
    if (eraser || this.tool === "eraser") return { path: [at] };
    if (this.tool === "ellipse") return { from: at, circle: true };
    const stroke = new Stroke(this.kind);
    stroke.add(...at, pressure);
    return { stroke, from: at, drawn: 0 };
  }

  extend(live, at, pressure, ruled) {
    if (live.path) {
      live.path.push(at.map((v) => Math.round(v * 100) / 100));
    } else if (live.circle) {
      if (Math.hypot(at[0] - live.from[0], at[1] - live.from[1]) > 2)
        this.radius = Math.max(0.02, Math.min(0.7, radiusTo(this.camera, live.from, at, this.axis)));
    } else if (ruled) {
      const { to, axis } = snapped(this.camera, live.from, at);
      if (!live.ruled) this.redrawWithout(live);
      live.ruled = { from: live.from, to, axis, pressure };
    } else {
      if (live.ruled) live.ruled = null;
      live.stroke.add(...at, pressure);
    }
  }

  redrawWithout(live) {
    live.stroke.points.length = 1;
    live.drawn = 0;
    this.redraw();
  }

  /** Puts on the canvas what `extend` has added. */
  lay(live) {
    if (live.path) {
      this.paper.erase(live.path, this.eraser, live.drawn ?? 0);
      live.drawn = live.path.length;
    } else if (live.stroke && !live.ruled) {
      this.paper.stroke(live.stroke, live.drawn);
      live.drawn = live.stroke.points.length;
    }
  }

  end(live, at) {
    if (live.path) {
      this.heard.erase(this.viewpoint, live.path, Math.round(this.eraser * 100) / 100);
      return;
    }
    let stroke = live.stroke;
    if (live.circle) {
      stroke = new Stroke(this.kind);
      for (const [x, y] of ellipse(this.camera, live.from, this.radius, this.axis)) stroke.add(x, y, 0.5);
    } else if (live.ruled) {
      stroke = new Stroke(this.kind);
      for (const [x, y, pressure] of straight(live.ruled.from, live.ruled.to, live.ruled.pressure))
        stroke.add(x, y, pressure);
    }
    this.heard.stroke(this.viewpoint, stroke.data);
    this.hover(at);
  }
}

function still() {
  return window.matchMedia("(prefers-reduced-motion: reduce)").matches;
}

function parseColour(text) {
  const digits = text.replace("#", "");
  const wide = digits.length === 3 ? [...digits].map((d) => d + d).join("") : digits;
  return [0, 2, 4].map((i) => parseInt(wide.slice(i, i + 2), 16) / 255);
}
