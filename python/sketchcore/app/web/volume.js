// The solid, cast from a 3D texture by WebGL2, in the wireframe cube of the working volume on a ground grid. A frame is
// drawn only when something has changed: at a reduced resolution, so as to keep up, while the camera moves, and at the
// full one (or finer, where the graphics processor is fast) once it rests.

import { BLOCKS, SIDE, paired, shadowOf, survey } from "./room.js";
import { LINE_FRAGMENT, LINE_VERTEX, RAY_FRAGMENT, SCREEN_VERTEX } from "./shaders.js";

const SCALES = [1, 0.71, 0.5, 0.35, 0.25];
const SLOW = 45; // milliseconds a moving frame may take
const QUICK = 18;
const REST = 140; // milliseconds without motion, then the camera rests
const PATIENT = 150; // milliseconds that a finer frame may take
const CALM = 400; // milliseconds without a change before one is begun: more than between two rounds

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [i & 1, (i >> 1) & 1, (i >> 2) & 1].map((x) => x - 0.5));
const EDGES = CORNERS.flatMap((_, i) => [1, 2, 4].filter((bit) => !(i & bit)).map((bit) => [i, i | bit]));

export class VolumeView {
  /**
   * @param canvas takes the whole stage; it is drawn into with alpha, over whatever lies behind it.
   * @param frame called before each frame: {camera, centre, side, moving, held}: the drawing area in CSS pixels; whether
   *   the camera moves by itself; whether someone has hold of it.
   */
  constructor(canvas, frame) {
    this.canvas = canvas;
    this.frame = frame;
    this.look = { opacity: 1, doubt: false, cube: 1, grid: 1, shade: 1 };
    this.colours = { clay: [0.8, 0.8, 0.8], alarm: [0.9, 0.4, 0.1], line: [0, 0, 0], edge: [0, 0, 0] };
    this.level = 1; // of SCALES, while moving
    this.last = { milliseconds: 0, scale: 1, width: 0, height: 0, frames: 0 };
    this.shown = 0; // opacity that the solid has reached on its way in
    this.empty = true;
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => this.start());
    this.start();
  }

  start() {
    const options = { alpha: true, premultipliedAlpha: true, antialias: false, depth: false, preserveDrawingBuffer: true };
    const gl = (this.gl = this.canvas.getContext("webgl2", options));
    if (!gl) throw new Error("This browser has no WebGL2, which the 3D view needs.");
    this.fence = null;
    this.rays = new Program(gl, SCREEN_VERTEX, RAY_FRAGMENT);
    this.lines = new Program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.bare = gl.createVertexArray();
    this.strip = new Strip(gl, this.lines);
    this.textures = {
      volume: texture3d(gl, 0, SIDE, gl.LINEAR, gl.RG8),
      unsure: texture3d(gl, 1, SIDE, gl.LINEAR),
      room: texture3d(gl, 2, BLOCKS, gl.NEAREST),
      shadow: texture2d(gl, 3),
    };
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.setVolume(this.volume ?? null);
    if (this.unsure) this.setUnsure(this.unsure);
  }

  /** The volume to show, uint8 [64, 64, 64] as [x][y][z], or null for none. */
  setVolume(volume) {
    const gl = this.gl;
    this.volume = volume;
    const bytes = volume ?? new Uint8Array(SIDE ** 3);
    Object.assign(this, survey(bytes));
    fill3d(gl, 0, this.textures.volume, SIDE, paired(bytes), gl.RG);
    fill3d(gl, 2, this.textures.room, BLOCKS, this.room);
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, this.textures.shadow);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, SIDE, SIDE, gl.RED, gl.UNSIGNED_BYTE, shadowOf(bytes));
    this.invalidate();
  }

  /** Where the solid is unsure, uint8 [64, 64, 64] as [x][y][z]. */
  setUnsure(unsure) {
    this.unsure = unsure;
    fill3d(this.gl, 1, this.textures.unsure, SIDE, unsure);
    this.invalidate();
  }

  /** Something has changed: draw a frame soon. `moving` says that more will change at once. */
  invalidate(moving = false) {
    this.changedAt = performance.now();
    if (moving) this.movedAt = this.changedAt;
    this.dirty = true;
    this.finer = false;
    this.schedule();
  }

  schedule() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.tick();
    });
  }

  tick() {
    if (this.gl.isContextLost()) return;
    if (this.fence) {
      // One frame at a time: what a slow graphics processor queues up would be late when it is seen.
      const done = this.gl.getSyncParameter(this.fence, this.gl.SYNC_STATUS) === this.gl.SIGNALED;
      if (!done) return this.schedule();
      this.settle();
    }
    const state = this.frame();
    // Where frames are slow, so are the events between them: rest is what lasts longer than two of them.
    const rest = Math.min(1000, Math.max(REST, 2 * this.last.milliseconds));
    const moving = state.moving || state.held || performance.now() - (this.movedAt ?? -rest) < rest;
    const ratio = window.devicePixelRatio || 1;
    if (moving) {
      if (this.dirty || state.moving) this.draw(state, ratio * SCALES[this.level], true);
      this.restless = true;
      this.schedule();
    } else if (this.dirty || this.restless) {
      this.restless = false;
      this.draw(state, ratio, false);
      this.schedule(); // to see how long it took
    } else if (!this.finer && this.last.scale === ratio && !this.last.moving) {
      const early = this.changedAt + CALM - performance.now();
      clearTimeout(this.calming);
      if (early > 0) return void (this.calming = setTimeout(() => this.schedule(), early));
      const finer = Math.min(2, Math.sqrt(PATIENT / Math.max(this.last.milliseconds, 1)));
      this.finer = true;
      if (finer > 1.2) {
        this.draw(state, ratio * finer, false);
        this.schedule();
      }
    }
  }

  settle() {
    this.gl.deleteSync(this.fence);
    this.fence = null;
    this.last.milliseconds = performance.now() - this.begun;
    this.last.frames += 1;
    if (!this.last.moving) return;
    if (this.last.milliseconds > SLOW) this.level = Math.min(SCALES.length - 1, this.level + 1);
    else if (this.last.milliseconds < QUICK && this.level > 0) this.level -= 1;
  }

  draw({ camera, centre, side }, scale, moving) {
    const gl = this.gl;
    this.dirty = false;
    this.begun = performance.now();
    const width = Math.max(1, Math.round(this.canvas.clientWidth * scale));
    const height = Math.max(1, Math.round(this.canvas.clientHeight * scale));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    Object.assign(this.last, { scale, width, height, moving });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const screen = { camera, x: centre[0] * scale, y: centre[1] * scale, half: (side * scale) / 2 / camera.tan, width, height };
    const [behind, before] = sortEdges(camera.position);
    const edge = (alpha) => [...this.colours.edge, alpha * this.look.cube];
    this.drawLines(behind, edge(0.28), 1.1 * scale, screen);
    this.drawSolid(screen, moving);
    this.drawLines(before, edge(0.5), 1.1 * scale, screen);
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  drawSolid({ camera, x, y, half, height }, moving) {
    const gl = this.gl;
    const { program, at } = this.rays;
    gl.useProgram(program);
    for (const [unit, name] of ["volume", "unsure", "room", "shadow"].entries()) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(name === "shadow" ? gl.TEXTURE_2D : gl.TEXTURE_3D, this.textures[name]);
      gl.uniform1i(at[name], unit);
    }
    const vectors = { eye: camera.position, right: camera.right, down: camera.down, forward: camera.forward };
    Object.assign(vectors, { low: this.low, high: this.high });
    for (const [name, value] of Object.entries(vectors)) gl.uniform3fv(at[name], value);
    for (const name of ["clay", "alarm", "line"]) gl.uniform3fv(at[name], this.colours[name]);
    gl.uniform2f(at.centre, x, y);
    const numbers = {
      half_side: half,
      height,
      stride: (moving ? 0.9 : 0.5) / SIDE,
      opacity: this.empty ? 0 : this.look.opacity,
      doubt: this.look.doubt ? 1 : 0,
      occlusion: moving ? 0 : 1,
      grid: this.look.grid * 0.2,
      shade: this.look.shade * (this.empty ? 0 : 0.5 * this.look.opacity),
    };
    for (const [name, value] of Object.entries(numbers)) gl.uniform1f(at[name], value);
    gl.bindVertexArray(this.bare);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  drawLines(segments, ink, width, screen) {
    if (ink[3] <= 0 || !segments.length) return;
    const data = segments.flatMap(([a, b]) => quad(a, b, width, screen));
    this.gl.useProgram(this.lines.program);
    this.gl.uniform4fv(this.lines.at.ink, ink);
    this.strip.draw(new Float32Array(data));
  }
}

// Edges that two faces turned away share lie behind everything in the cube; all others before it.
function sortEdges(eye) {
  const behind = [];
  const before = [];
  for (const [i, j] of EDGES) {
    const turned = [0, 1, 2].filter((axis) => CORNERS[i][axis] === CORNERS[j][axis]);
    const hidden = turned.every((axis) => eye[axis] * Math.sign(CORNERS[i][axis]) < 0.5);
    (hidden ? behind : before).push([CORNERS[i], CORNERS[j]]);
  }
  return [behind, before];
}

// Two triangles: clip coordinates and the place across the line, six corners of four numbers; none behind the eye.
function quad(a, b, width, { camera, x, y, half, width: w, height: h }) {
  const near = 0.02;
  const seen = (p) => {
    const d = p.map((v, i) => v - camera.position[i]);
    return [camera.right, camera.down, camera.forward].map((axis) => axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2]);
  };
  let [p, q] = [seen(a), seen(b)];
  if (p[2] < near && q[2] < near) return [];
  const cut = (from, to) => from.map((v, i) => v + ((to[i] - v) * (near - from[2])) / (to[2] - from[2]));
  if (p[2] < near) p = cut(p, q);
  else if (q[2] < near) q = cut(q, p);
  const pixel = (r) => [x + (half * r[0]) / r[2], y + (half * r[1]) / r[2]];
  const [u, v] = [pixel(p), pixel(q)];
  const length = Math.hypot(v[0] - u[0], v[1] - u[1]) || 1;
  const reach = width / 2 + 1;
  const normal = [((v[1] - u[1]) / length) * reach, ((u[0] - v[0]) / length) * reach];
  const corner = (at, sign) => [
    ((at[0] + sign * normal[0]) * 2) / w - 1,
    1 - ((at[1] + sign * normal[1]) * 2) / h,
    sign * reach,
    width / 2,
  ];
  const [c0, c1, c2, c3] = [corner(u, -1), corner(u, 1), corner(v, -1), corner(v, 1)];
  return [...c0, ...c1, ...c2, ...c2, ...c1, ...c3];
}

class Program {
  constructor(gl, vertex, fragment) {
    const program = gl.createProgram();
    for (const [kind, source] of [
      [gl.VERTEX_SHADER, vertex],
      [gl.FRAGMENT_SHADER, fragment],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(gl.getShaderInfoLog(shader));
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(gl.getProgramInfoLog(program));
    this.program = program;
    this.at = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const { name } = gl.getActiveUniform(program, i);
      this.at[name] = gl.getUniformLocation(program, name);
    }
  }
}

class Strip {
  constructor(gl, { program }) {
    this.gl = gl;
    this.array = gl.createVertexArray();
    this.buffer = gl.createBuffer();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    for (const [offset, name] of ["place", "side"].entries()) {
      const at = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, 2, gl.FLOAT, false, 16, offset * 8);
    }
    gl.bindVertexArray(null);
  }

  draw(data) {
    const gl = this.gl;
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STREAM_DRAW);
    gl.drawArrays(gl.TRIANGLES, 0, data.length / 4);
  }
}

function texture3d(gl, unit, side, filter, format = gl.R8) {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_3D, texture);
  gl.texStorage3D(gl.TEXTURE_3D, 1, format, side, side, side);
  gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, filter);
  gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, filter);
  for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R])
    gl.texParameteri(gl.TEXTURE_3D, wrap, gl.CLAMP_TO_EDGE);
  return texture;
}

function texture2d(gl, unit) {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R8, SIDE, SIDE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  return texture;
}

function fill3d(gl, unit, texture, side, bytes, format = gl.RED) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_3D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, 0, side, side, side, format, gl.UNSIGNED_BYTE, bytes);
}
